"""The worlds that a training meets beside its own where nothing else is asked for: one policy is to hold in all."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from wsn_env.models.quantity import ScenarioError, parse_overrides
from wsn_env.scenario import Scenario

SHARES = (1 / 3, 2, 40 / 9)  # of the nodes
FEWER = 4 / 9
SPEEDS_MS = {"Binary-v0": 5.0, "Anchors-v0": 2.0}  # of their own targets, about; elsewhere 1 m/s
# For a filter that finds out: from 0.15 to 3 times the usual speed; turning, wandering, with rests.
MOTIONS: tuple[dict[str, Any], ...] = (
    dict(motion="turns", speed_ms=1.0),
    dict(motion="turns", speed_ms=1.0, nodes=FEWER),
    dict(motion="waypoint", speed_ms=1.0),
    dict(motion="waypoint", speed_ms=0.3),
    dict(motion="waypoint", speed_ms=2.5),
    dict(motion="circle", circle_m=30.0),
    dict(motion="sine", speed_ms=0.9, amplitude_m=25.0),
    dict(motion="walk", slowest_ms=0.14, fastest_ms=0.73),
    dict(motion="walk", slowest_ms=0.14, fastest_ms=1.5),
)
PARTICLES = 1000  # in these worlds, at most: as good as more for learning, and sooner done


def default_worlds(scenario: Scenario) -> list[str]:
    """As `--vary` takes them: other numbers of nodes, motions, noises, a loss of packets, a target that stops; what
    does not fit the scenario is left out."""
    worlds = [f"nodes={nodes_of(scenario, share)}" for share in SHARES]
    if scenario.tracking.switches:
        worlds += [_moving(scenario, **motion) for motion in MOTIONS]
        if scenario.name in SPEEDS_MS:  # and as slow as motions are where nothing is said
            worlds += ["motion=turns", "motion=circle"]
    worlds += [noise for factor in (0.5, 2.0) for noise in noises(scenario, factor)]
    worlds += ["packet_success=0.7"]
    if scenario.tracking.switches:
        worlds += ["faults=stops"]
    if scenario.tracking.particles > PARTICLES:
        worlds = [f"particles={PARTICLES},{world}" for world in worlds]
    return [world for world in worlds if _is_another(world, scenario)]


def world_of(text: str) -> dict[str, Any]:
    """The quantities of one: "nodes=81,motion=turns"; faults are last: "nodes=81,faults=stuck+late"."""
    others, faulty, faults = text.partition("faults=")
    quantities = parse_overrides(filter(None, others.split(",")))
    return quantities | ({"faults": faults} if faulty else {})


def noises(scenario: Scenario, factor: float) -> list[str]:
    """The measurement's noise, so many times; none where it has no such quantity."""
    named = [item.name for item in fields(scenario.measurement) if item.name in ("noise_m", "noise_db")]
    return [f"{name}={getattr(scenario.measurement, name) * factor:g}" for name in named]


def _moving(scenario: Scenario, motion: str, nodes: float = 1.0, **lengths: float) -> str:
    """A motion whose lengths and speeds suit the scenario."""
    scale = SPEEDS_MS.get(scenario.name, 1.0)
    settings = [f"{name}={value * scale:g}" for name, value in lengths.items()]
    more = [f"nodes={nodes_of(scenario, nodes)}"] if nodes != 1.0 else []
    return ",".join([f"motion={motion}", *settings, *more])


def nodes_of(scenario: Scenario, share: float) -> int:
    """So many of its nodes; a grid has a square of them."""
    nodes = scenario.field.nodes * share
    return round(nodes**0.5) ** 2 if scenario.field.layout == "grid" else round(nodes)


def _is_another(world: str, scenario: Scenario) -> bool:
    """Whether it fits, and is not the scenario as it is."""
    try:
        made = scenario.override(**world_of(world))
        made.motion.check(made)
    except ScenarioError:
        return False
    return made != scenario
