"""Frames: what `render()` returns and a window shows."""
