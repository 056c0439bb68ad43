"""Whether networks last longer with one system than with another: when their nodes have died."""

from __future__ import annotations

import numpy as np

from wsn_env.evaluation.intervals import standard_error
from wsn_env.papers.claim import Claim, judge_claim
from wsn_env.papers.rollout import Record, exceeds

DEAD = ((1e-9, "the first node"), (0.1, "a tenth"), (0.5, "half of them"))  # shares of the nodes


def judge_lifetimes(claim: str, paper: str, battery: str, nodes: int, longer: Record, shorter: Record) -> Claim:
    """Plainly: at every share of DEAD; under a reading: when half of the nodes have died.

    Args:
        battery: a node's, in words.
        nodes: how many there are.
        longer, shorter: of small batteries and a target that never leaves.
    """
    good, parts = [], []
    for share, what in DEAD:
        ours, theirs = (periods_until_dead(record, nodes, share) for record in (longer, shorter))
        good.append(exceeds(ours, theirs))
        parts.append(f"{what} after {_mean_and_error(ours)} against {_mean_and_error(theirs)} periods")
    text = f"with batteries of {battery} and a target that never leaves, dead: {', '.join(parts)}"
    return Claim(claim, paper, text, judge_claim(all(good), good[-1]))


def periods_until_dead(record: Record, nodes: int, share: float) -> np.ndarray:
    """(R,) the period in which this share of the nodes has died; all of them where it never happens."""
    dead = record.alive <= (1 - share) * nodes
    return np.where(dead.any(axis=1), dead.argmax(axis=1) + 1, dead.shape[1])


def _mean_and_error(counts: np.ndarray) -> str:
    return f"{counts.mean():.0f} ({standard_error(counts):.0f})"
