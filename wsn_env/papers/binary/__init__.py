"""Binary sensors: locating and tracking with one bit (Zhou, Cheng & Xing, 2009), its experiments beside ours."""

from wsn_env.papers.binary.rebuild import reproduce

__all__ = ["reproduce"]
