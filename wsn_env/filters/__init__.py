"""Trackers: belief and reports in, belief out. `make_tracker` finds them by name."""

from wsn_env.filters.choice import make_tracker

__all__ = ["make_tracker"]
