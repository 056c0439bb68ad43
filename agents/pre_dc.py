"""Prediction-based dynamic clustering (Xiang & Guo, 2013)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wsn_env.agents.base import ViewPolicy
from wsn_env.models.quantity import check_quantity
from wsn_env.models.state import Cluster
from wsn_env.scenario.sensing import joint_detection_probability
from wsn_env.simulation.view import View


@dataclass(frozen=True)
class PreDC(ViewPolicy):
    """Keep the cluster while the prediction is sharp and the cluster would detect there; else form a new one.

    The new head is the living node nearest to the prediction that has the energy for a handover and one period, and
    the residual energy `least_left`; its neighbours join in order of detection probability until the joint probability
    exceeds theta. Where no node that could detect the target has so much, all count.

    Differs from the paper: as printed only E >= Phi0 ends a cluster, so that one that the target has left keeps
    waiting; here the joint detection probability at the prediction must also stay at `keep_theta` or above.
    """

    theta: float = 0.9  # theta_d: joint detection probability wanted
    keep_theta: float | None = None  # joint probability that keeps a cluster; None: theta; 0: as printed
    phi0_m: float = 2.0  # Phi0: prediction sd from which the cluster is formed anew [m]
    least_left: float = 0.0  # share of a full battery that a node of a new cluster must have left
    sees_lam = False

    def __post_init__(self) -> None:
        check_quantity("PreDC", "theta", self.theta, at_least=0, at_most=1)
        check_quantity("PreDC", "keep_theta", self.keep_theta, at_least=0, at_most=1, optional=True)
        check_quantity("PreDC", "phi0_m", self.phi0_m, at_least=0)
        check_quantity("PreDC", "least_left", self.least_left, at_least=0, at_most=1)

    def act(self, view: View) -> Cluster:
        """Keep or form, for every row."""
        p = self.detection(view)
        keep_theta = self.theta if self.keep_theta is None else self.keep_theta
        standing = joint_detection_probability(np.where(view.member, p, 0.0))
        keep = np.asarray((view.spread_m < self.phi0_m) & (standing >= keep_theta) & (view.head >= 0))
        head, chosen = self._form(view, p)
        return Cluster.of(np.where(keep, view.head, head), np.where(keep[:, None], view.member, chosen))

    def _form(self, view: View, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Heads (B,) and members (B, S) of new clusters."""
        rested = view.alive & (view.battery >= self.least_left * view.full_j[:, None])
        rested = np.where(np.any(rested & (p > 0), axis=1, keepdims=True), rested, view.alive)
        able = rested & (view.battery >= self._head_energy_j(p)[:, None])
        able = np.where(np.any(able, axis=1, keepdims=True), able, rested)
        head = np.where(able.any(axis=1), np.where(able, view.distance, np.inf).argmin(axis=1), -1)

        # Nearest first is by probability first; the head goes before all.
        rank = view.distance.copy()
        living = np.flatnonzero(head >= 0)
        rank[living, head[living]] = -1.0
        order = np.argsort(np.where(rested, rank, np.inf), axis=1, kind="stable")
        sorted_p = np.take_along_axis(p, order, axis=1)
        before = 1.0 - np.cumprod(1.0 - sorted_p, axis=1)
        before = np.concatenate([np.zeros((len(p), 1)), before[:, :-1]], axis=1)
        joins = (sorted_p > 0) & (before <= self.theta) & np.take_along_axis(rested, order, axis=1)
        chosen = np.zeros_like(joins)
        np.put_along_axis(chosen, order, joins, axis=1)
        return head, chosen

    def _head_energy_j(self, p: np.ndarray) -> np.ndarray:
        """(B,) energy of a handover (received, and passed on across the sensing range) and of hearing one period."""
        radio, bits = self.scenario.radio, self.scenario.handover_bits
        handover = radio.receiving_j(bits) + radio.sending_j(bits, 2 * self.scenario.reach_m)
        return handover + radio.receiving_j(radio.report_bits) * (p > 0).sum(axis=1)
