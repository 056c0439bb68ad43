"""An episode as plain numbers, period by period: what a page shows of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from wsn_env.compiled import draws
from wsn_env.envs.rendering import colours
from wsn_env.envs.rendering.plan import legend, shows_radius
from wsn_env.evaluation.policies import Policy
from wsn_env.evaluation.rollout import episodes
from wsn_env.models.state import Outcome, State
from wsn_env.scenario import Scenario
from wsn_env.simulation.view import View
from wsn_env.simulation.world import World

HUES = {  # by symbol of the frames' legend
    "member": colours.BLUE,
    "head": colours.VERMILION,
    "sink": colours.VERMILION,
    "heard": colours.ORANGE,
    "report": colours.ORANGE,
    "handover": colours.PURPLE,
    "cloud": colours.SKY,
    "target": colours.GREEN,
    "search": colours.YELLOW,
}
CLOUD = 120  # particles shown of a period, at most
LONG = 400  # periods, from which on fewer are shown
FINE, COARSE = 9999, 999  # steps across the room: of lines and of clouds


@dataclass(frozen=True)
class Episode:
    """What one policy made of an episode; frames[k] is after k periods. Errors are means over the targets."""

    policy: str
    frames: list[dict[str, object]]
    rms_m: float
    energy_mj: float  # in a period
    total: float  # return


@dataclass(frozen=True)
class Recording:
    """An episode, and what each of some policies made of it."""

    episodes: list[Episode]
    common: dict[str, object]  # the room, the nodes, the tracks


def record(policies: dict[str, Policy], scenario: Scenario, seed: int) -> Recording:
    """Play an episode, the very one of `reset(seed=seed)`, under each policy.

    Args:
        policies: by name.
        scenario: with one lam.
        seed: of the episode.
    """
    world = World(scenario, threads=1)
    played = [_play_episode(name, policy, world, seed) for name, policy in policies.items()]
    keys = np.repeat([draws.key_of_seed(seed)], scenario.targets)
    return Recording(played, _common_data(world.reset(keys), scenario, seed))


def _play_episode(name: str, policy: Policy, world: World, seed: int) -> Episode:
    scenario = world.scenario
    frames, squares, joules, total = [], [], [], 0.0

    def add_frame(state: State, outcome: Outcome) -> None:
        frames.append(_frame(state, outcome, scenario))

    for state, outcome in episodes(policy, world, [seed], begin=add_frame):
        add_frame(state, outcome)
        squares.append(np.mean(outcome.error_m**2))
        joules.append(outcome.energy_mj.sum())
        total -= float(np.sum(scenario.counted_m(outcome.error_m) + state.lam * outcome.energy_mj))
    scored = squares[scenario.unscored :]
    return Episode(name, frames, float(np.sqrt(np.mean(scored))), float(np.mean(joules)), float(total))


def _common_data(state: State, scenario: Scenario, seed: int) -> dict[str, object]:
    width, depth = scenario.field.room_m
    whole = max(width, depth)
    receiver = scenario.radio.receiver
    searches = [("search", "search")] if scenario.tracking.search or scenario.tracking.start == "search" else []
    return {
        "scenario": scenario.name,
        "seed": seed,
        "lam": float(state.lam[0]),
        "period_s": scenario.period_s,
        "unscored": scenario.unscored,
        "room_m": [width, depth],
        "unit_m": whole / FINE,
        "coarse_m": whole / COARSE,
        "radius_m": scenario.radius_m if shows_radius(scenario) else None,
        "battery_j": float(state.full_j[0]),
        "receiver": receiver,
        "hue": HUES,
        "legend": [(symbol, words) for symbol, words in legend(scenario) if symbol in HUES] + searches,
        "nodes": _grid_steps(state.network.positions[0], whole),
        "tracks": [_grid_steps(track[:, ::2], whole) for track in state.track],
    }


def _grid_steps(points: ArrayLike, whole: float, steps: int = FINE) -> list[int]:
    """Coordinates [m] as whole steps, x and y in turn."""
    return np.rint(np.asarray(points, float) * (steps / whole)).astype(int).ravel().tolist()


def _frame(state: State, outcome: Outcome, scenario: Scenario) -> dict[str, object]:
    """A period of a batch of one field."""
    charged = {int(node) for row in range(state.rows) for node in state.ledger.charged[row, : state.ledger.count[row]]}
    return {
        "targets": [_of_target(state, outcome, row, scenario) for row in range(state.rows)],
        "left_j": [[node, float(f"{state.residual_j[0, node]:.7g}")] for node in sorted(charged)],
        "error": round(float(outcome.error_m.mean()), 3),
        "energy": round(float(outcome.energy_mj.sum()), 5),
        "awake": int(outcome.members.sum()),
        "search": bool(outcome.searched.any()),
        "handover": bool(outcome.handover.any()),
    }


def _of_target(state: State, outcome: Outcome, row: int, scenario: Scenario) -> dict[str, object]:
    """Its belief and its cluster."""
    whole = max(scenario.field.room_m)
    network, belief, reports = state.network, state.belief.row[row], state.reports
    x = state.belief.particles[row]
    points = CLOUD * LONG // max(LONG, scenario.periods) // scenario.targets or 1
    shown = slice(0, None, max(1, -(-x.shape[1] // points)))
    told = {
        "mean": _grid_steps(belief["mean"][::2], whole),
        "cov": [float(f"{belief['cov'][i, j]:.3g}") for i, j in ((0, 0), (0, 2), (2, 2))],
        "cloud": _grid_steps(np.clip(x[::2, shown].T, 0, whole), whole, COARSE),
        "head": int(network.head[row]),
        "members": network.members[row, : network.n_members[row]].tolist(),
        "heard": reports.node[row, : reports.count[row]].tolist(),
        "handover": bool(outcome.handover[row]),
    }
    if scenario.measurement.reports_state:
        told["detects"] = np.flatnonzero(View(state.knowledge).sees[row]).tolist()
    return told
