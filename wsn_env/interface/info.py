"""What an environment tells loggers of a period."""

import numpy as np

from wsn_env.types import Outcome, State


def measures(outcome: Outcome, state: State, reward: np.ndarray) -> dict[str, np.ndarray]:
    """The info of a period, (B, ...) each. It carries truth: for loggers only, never for policies.

    Args:
        reward: (B,) of the period; its two parts are told apart here.
    """
    energy_mj = outcome.energy_mj
    cost = state.lam * energy_mj
    return {
        "error_m": outcome.error_m,
        "energy_mj": energy_mj,
        "reward_error": reward + cost,
        "reward_energy": -cost,
        "members": outcome.members,
        "delivered": outcome.delivered,
        "dropped": outcome.dropped,
        "handover": outcome.handover.astype(bool),
        "searched": outcome.searched.astype(bool),
        "n_eff": state.belief.n_eff.copy(),
        "posterior_rms_m": outcome.posterior_rms_m,
        "alive": outcome.alive,
        "target_m": outcome.target_m,
        "estimate_m": outcome.estimate_m,
    }
