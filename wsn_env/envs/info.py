"""What an environment tells loggers of a period."""

from collections.abc import Callable, Mapping
from typing import Any

OUTCOME_FIELDS = (
    "error_m",
    "energy_mj",
    "members",
    "detections",
    "delivered",
    "dropped",
    "handover",
    "searched",
    "n_eff",
    "posterior_rms_m",
    "believed_error_m",
    "alive",
    "target_m",
    "estimate_m",
)


def period_info(outcome: Mapping[str, Any], lam: Any, reward: Any, counted: Callable[[Any], Any]) -> dict[str, Any]:
    """The info of a period. It carries truth: for loggers only, never for policies.

    Args:
        outcome: the fields of OUTCOME by name, arrays (B, ...) or the numbers of one row.
        lam: (B,) or a number.
        reward: of the period; its two parts are told apart here. None, of a vector reward: they are the parts of the
            mission's reward at this lam.
        counted: the scenario's `counted_m`.
    """
    info = {name: outcome[name] for name in OUTCOME_FIELDS}
    info["reward_energy"] = -lam * outcome["energy_mj"]
    info["reward_error"] = -counted(outcome["error_m"]) if reward is None else reward - info["reward_energy"]
    return info
