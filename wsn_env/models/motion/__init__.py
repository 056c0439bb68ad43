"""How targets move, a kind a file."""
