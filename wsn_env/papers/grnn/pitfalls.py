"""How not to evaluate such a system: two errors that make metres out of nothing, and what they hide.

Published figures of a metre or so for fingerprints with a filter come from programs that set the filter back to the
true state in every period, or train the network on the very path that it is tested on. Both are rebuilt here, apart
from the world and its trackers, beside the honest figures.
"""

from __future__ import annotations

import numpy as np

from wsn_env.filters.fingerprint import FingerprintMap, FingerprintNetwork, trained_network
from wsn_env.filters.kalman import constant_velocity
from wsn_env.filters.linear import LinearModel
from wsn_env.models.field import fixed_positions
from wsn_env.papers.grnn.systems import NOISE_DB, scenario_as_read, track
from wsn_env.papers.rollout import pooled_rms
from wsn_env.papers.sheet import Sheet
from wsn_env.scenario import Scenario

PERIOD_S, SEED = 1.0, 7
TRUTH_COV = np.diag([0.25, 0.02, 0.04, 0.01])  # what such programs believe of x, vx, y, vy after the reset


def pitfalls(runs: int) -> Sheet:
    """Root mean square errors [m] of honest and of leaking evaluations, at T = 1 s."""
    rng, scenario = np.random.default_rng(SEED), scenario_as_read("grnn", PERIOD_S)
    nodes, model = np.asarray(fixed_positions(scenario.field)), LinearModel(scenario)
    states = track(PERIOD_S)
    truth = states[1:, ::2]
    mirrored = truth * (-1, 1) + (scenario.field.side_m, 0)
    honest = trained_network(scenario)
    on_path = FingerprintMap.survey(truth, nodes, model, np.inf, 1, rng)
    cheat = FingerprintNetwork(on_path, honest.width, honest.noise, 0.0)

    def fixes(network: FingerprintNetwork, points: np.ndarray) -> np.ndarray:
        heard = model.expected(points, nodes) + rng.normal(0.0, NOISE_DB, (runs, len(points), len(nodes)))
        return np.stack([network.fixes(np.arange(len(nodes)), strengths) for strengths in heard])

    same = fixes(honest, truth)
    cases = {
        "network trained on a grid": same - truth,
        "the same, then a filter set back to the truth in every period": _reset(same, states, scenario) - truth,
        "network trained on the test path": fixes(cheat, truth) - truth,
        "the same on the mirrored path": fixes(cheat, mirrored) - mirrored,
        "network trained on a grid, on the mirrored path": fixes(honest, mirrored) - mirrored,
    }
    rows = [(name, *pooled_rms((offset**2).sum(axis=-1))) for name, offset in cases.items()]
    return Sheet(("evaluation", "RMSE m", "stderr_m"), rows)


def _reset(fixes: np.ndarray, states: np.ndarray, scenario: Scenario) -> np.ndarray:
    """A Kalman filter that begins every period at the true state of the one before."""
    transition, noise = constant_velocity(scenario)
    cov = (transition @ TRUTH_COV @ transition.T + noise)[::2, ::2]
    gain = cov @ np.linalg.inv(cov + np.cov((fixes - states[1:, ::2]).reshape(-1, 2).T))
    predicted = (states[:-1] @ transition.T)[:, ::2]
    return predicted + (fixes - predicted) @ gain.T
