"""Parameters of hand-written rules, tuned on episodes that nothing else meets (`python -m studies.tuning`)."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wsn_env.scenario import Scenario

# Whose rules serve until a scenario has its own: its periods differ in horizon, batteries and what an error counts.
SAME_PERIODS = {"Lifetime-v0": "PreDC-v0"}
TABLE = Path(__file__).with_name("tuned.json")


def tuned(scenario: Scenario, rule: str) -> Any:
    """What was found best for a rule in the scenario of this name; None: nothing was tuned."""
    table = _load_table()
    name = scenario.name if scenario.name in table else SAME_PERIODS.get(scenario.name, "")
    return table.get(name, {}).get(rule)


def nearest_lam(lams: npt.ArrayLike, lam: npt.ArrayLike) -> np.ndarray:
    """(B,) which of `lams` is nearest to each `lam`, on the logarithmic scale; the smaller wins a tie."""
    logs, log = (np.log(np.maximum(np.asarray(values, dtype=float), 1e-9)) for values in (lams, lam))
    return abs(log[:, None] - logs).argmin(axis=1)


@cache
def _load_table() -> dict[str, Any]:
    return json.loads(TABLE.read_text(encoding="utf-8"))["scenarios"]
