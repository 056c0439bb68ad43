"""Studies of learning: long, resumable, reported in docs/learning.md."""
