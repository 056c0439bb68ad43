"""What talking costs, a kind a file."""
