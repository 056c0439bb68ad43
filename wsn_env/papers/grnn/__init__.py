"""Fingerprints and an iterated cubature Kalman filter (Lan, Nie et al.): its comparisons beside ours."""

from wsn_env.papers.grnn.rebuild import reproduce

__all__ = ["reproduce"]
