"""When nodes detect, a kind a file."""
