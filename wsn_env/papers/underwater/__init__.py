"""Tracking under water by the strongest signal (patent CN103152791), its claims beside ours."""

from wsn_env.papers.underwater.rebuild import reproduce

__all__ = ["reproduce"]
