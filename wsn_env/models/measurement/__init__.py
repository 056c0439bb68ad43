"""What nodes measure, a kind a file."""
