"""Fig. 1 of Xiang & Guo (2013): the cluster about the target in one period."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from wsn_env.envs.rendering.colours import BLACK, BLUE, DARK, FAINT, GREEN, GREY, VERMILION
from wsn_env.evaluation.policies import make_policy
from wsn_env.evaluation.rollout import FIRST_SEED, episodes
from wsn_env.papers.rollout import Trial
from wsn_env.papers.sheet import Sheet, tidy
from wsn_env.simulation.world import World

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PERIOD = 50
AROUND_M = 15.0  # half the width of the enlarged part


@dataclass(frozen=True, eq=False)
class Situation:
    """A period of the first run of a trial; S nodes."""

    positions_m: np.ndarray  # (S, 2)
    head: int
    members: np.ndarray  # without the head
    reported: np.ndarray  # nodes that the head had a report of, its own included
    prediction_m: np.ndarray  # (2,) before the period
    target_m: np.ndarray  # (2,)
    estimate_m: np.ndarray  # (2,) after the period
    radius_m: float


def play_until(trial: Trial, period: int = PERIOD) -> Situation:
    """Play the first run of a trial up to a period, 2 or later."""
    world = World(trial.scenario)
    policy = make_policy(trial.policy, trial.scenario, **dict(trial.parameters))
    steps = episodes(policy, world, [FIRST_SEED])
    for _ in range(period - 1):
        state, _ = next(steps)
    prediction = state.belief.predicted_mean[0, [0, 2]].copy()
    state, outcome = next(steps)
    return Situation(
        positions_m=state.network.positions[0].copy(),
        head=int(state.network.head[0]),
        members=state.network.members[0, : state.network.n_members[0]].copy(),
        reported=state.reports.node[0, : state.reports.count[0]].copy(),
        prediction_m=prediction,
        target_m=outcome.target_m[0].copy(),
        estimate_m=outcome.estimate_m[0].copy(),
        radius_m=trial.scenario.radius_m,
    )


def list_cluster(situation: Situation) -> Sheet:
    """Every node with its part, then target, prediction and estimate."""
    parts = np.full(len(situation.positions_m), "asleep", dtype=object)
    parts[situation.members], parts[situation.head] = "member", "head"
    reported = np.isin(np.arange(len(parts)), situation.reported)
    places = zip(situation.positions_m, parts, reported.tolist(), strict=True)
    rows: list[tuple] = [(part, node, told, *place) for node, (place, part, told) in enumerate(places)]
    for name in ("target", "prediction", "estimate"):
        rows.append((name, None, None, *getattr(situation, f"{name}_m")))
    return Sheet(("what", "node", "reported", "x_m", "y_m"), rows)


def draw_cluster(situation: Situation) -> Figure:
    """The whole field, and the cluster enlarged."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.5, 5.6), layout="constrained")
    field, near = figure.subplots(1, 2)
    for axes in (field, near):
        _draw_situation(axes, situation)
        axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
        tidy(axes)
    x, y = situation.prediction_m
    field.set(title=f"the field, {len(situation.positions_m)} nodes", xlim=(0, 100), ylim=(0, 100))
    near.set(title="the cluster", xlim=(x - AROUND_M, x + AROUND_M), ylim=(y - AROUND_M, y + AROUND_M))
    field.indicate_inset_zoom(near, edgecolor=DARK)
    figure.legend(*near.get_legend_handles_labels(), frameon=False, ncols=4, loc="outside lower center")
    figure.suptitle(f"Fig. 1: the cluster of Pre-DC at k = {PERIOD}, the first run")
    return figure


def _draw_situation(axes: Axes, situation: Situation) -> None:
    positions, head = situation.positions_m, situation.positions_m[situation.head]
    for member in situation.members:
        axes.plot(*np.stack([head, positions[member]], axis=1), color=GREY, linewidth=1.0, zorder=1)
    turn = np.linspace(0.0, 2 * np.pi, 200)
    circle = situation.prediction_m[:, None] + situation.radius_m * np.stack([np.cos(turn), np.sin(turn)])
    axes.plot(*circle, color=GREY, linestyle=":", label="sensing radius about the prediction")
    awake = np.append(situation.members, situation.head)
    asleep = np.delete(positions, awake, axis=0)
    _mark(axes, asleep, "asleep", s=14, color=FAINT)
    _mark(axes, positions[situation.members], "member", s=55, color=BLUE, zorder=2)
    _mark(axes, head, "head", s=75, color=VERMILION, marker="s", zorder=2)
    reported = positions[situation.reported]
    _mark(axes, reported, "has reported", s=190, facecolors="none", edgecolors=BLACK, zorder=2)
    _mark(axes, situation.target_m, "target", s=110, color=BLACK, marker="*", zorder=3)
    _mark(axes, situation.prediction_m, "prediction", s=70, color=GREEN, marker="x", zorder=3)
    _mark(axes, situation.estimate_m, "estimate", s=70, color=GREEN, marker="+", zorder=3)


def _mark(axes: Axes, points: np.ndarray, label: str, **style: Any) -> None:
    """Points (2,) or (n, 2)."""
    x, y = np.atleast_2d(points).T
    axes.scatter(x, y, label=label, **style)
