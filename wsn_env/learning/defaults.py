"""What a training takes where nothing else is asked for, by scenario."""

from __future__ import annotations

from wsn_env.models.measurement.base import Order
from wsn_env.scenario import Scenario


def default_order(scenario: Scenario) -> Order:
    """The menu's order of merit: by what the nodes measure."""
    return scenario.measurement.order


def default_level(scenario: Scenario) -> float:
    """How far advantages are levelled: wholly with positions; with strengths it was tried, and did not help."""
    return 1.0 if scenario.measurement.order == "nearest" else 0.0


def default_node_counts(scenario: Scenario) -> list[int]:
    """Numbers of nodes: 75 and 450 for the 225 of PreDC-v0, 150 and 450 for those of Rssi-v0; none where every node has
    its place. Sparser fields lose many tracks, and did not help where advantages are not levelled."""
    if scenario.field.positions is not None:
        return []
    fewer = 1 / 3 if default_level(scenario) > 0.0 else 2 / 3
    counts = [scenario.field.nodes * share for share in (fewer, 2)]
    return [round(n**0.5) ** 2 if scenario.field.layout == "grid" else round(n) for n in counts]
