"""Fingerprints and an iterated cubature Kalman filter (Lan, Nie et al.): its comparisons beside ours."""

from wsn_env.papers.grnn.rebuild import equal_information, poor_start, reproduce, rmse

__all__ = ["equal_information", "poor_start", "reproduce", "rmse"]
