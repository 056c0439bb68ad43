"""How well recent reports fitted what the filter had predicted."""

from typing import Any

from wsn_env.compiled.kernels import lean_piece

LEAST_LEARNT, MOST_SURPRISE = 0.01, 100.0
REMEMBERED = 0.2  # share of the last period in the mean


@lean_piece
def note_surprise(belief: Any) -> None:
    """How far a period's reports have moved the estimate, over what was expected, with the positions' covariances P

        |x - x_predicted|^2 / (tr P_predicted - tr P)

    whose mean is about 1 where the filter's model holds; averaged over the last few periods with reports.

    Args:
        belief: BELIEF after the correction, its prediction still that of the period; `surprise` is renewed.
    """
    mean, cov, predicted, before = belief.mean, belief.cov, belief.predicted_mean, belief.predicted_cov
    spread = before[0, 0] + before[2, 2]
    learnt = spread - cov[0, 0] - cov[2, 2]
    if learnt > LEAST_LEARNT * spread:
        moved = (mean[0] - predicted[0]) ** 2 + (mean[2] - predicted[2]) ** 2
        belief.surprise += REMEMBERED * (min(moved / learnt, MOST_SURPRISE) - belief.surprise)
