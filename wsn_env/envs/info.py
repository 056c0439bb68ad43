"""What of a period's outcome an environment tells loggers: truth, never for policies."""

from typing import Any

import numpy as np

from wsn_env.models.state import OUTCOME

NAMES = OUTCOME.names or ()
OUTCOME_FIELDS = NAMES[: NAMES.index("energy_j")]


def outcomes_by_name(outcomes: np.ndarray) -> dict[str, np.ndarray]:
    """OUTCOME_FIELDS of outcomes (B,), each (B, ...)."""
    return {name: outcomes[name] for name in OUTCOME_FIELDS}


def outcome_by_name(outcome: np.ndarray) -> dict[str, Any]:
    """OUTCOME_FIELDS of an outcome (1,) as Python's numbers."""
    return dict(zip(OUTCOME_FIELDS, outcome.item()))
