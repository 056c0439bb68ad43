"""The world: its state, a period, what policies may see of it."""
