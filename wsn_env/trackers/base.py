"""What trackers without particles share."""

from wsn_env.types import Belief


class MomentTracker:
    """Base of the trackers whose whole belief is a mean and a covariance: final classes add `correct`."""

    particles = 0

    def start(self, keys, periods, rows, belief: Belief) -> None:
        """Nothing to spread."""

    def relocate(self, keys, periods, rows, belief: Belief) -> None:
        """Nothing to move but what a search has set."""
