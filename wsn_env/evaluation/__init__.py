"""Policies played, measured and compared."""
