"""Recorded motion and recorded radio, read from files."""
