"""The picture of one episode: who led where, the target's track and what was believed of it."""

from __future__ import annotations

from typing import Any

import numpy as np

from wsn_env.envs.rendering.colours import BLUE, DARK, GREY, VERMILION
from wsn_env.evaluation.policies import Policy, named_policies
from wsn_env.evaluation.rollout import FIRST_SEED, episodes
from wsn_env.models.arguments import checked_but
from wsn_env.models.quantity import whole_number
from wsn_env.reports.pictures import escape_label
from wsn_env.reports.plots import axes_of
from wsn_env.scenario import Scenario
from wsn_env.simulation.world import World


@checked_but("policy", "seed")
def plot_episode(policy: str | Policy, scenario: str | Scenario, seed: int = FIRST_SEED, ax: Any = None) -> Any:
    """Play an episode and draw it from above, for a notebook.

    Args:
        policy: its name, or itself.
        scenario: with one lam; or a preset's name.
        seed: of the episode, as of `reset(seed=...)` and of an evaluation's rows.
        ax: axes to draw in; None: new ones.

    Returns: the axes.
    """
    scenario, seed = Scenario.of(scenario), whole_number("seed", seed, 0)
    scenario.check_one_target("plot_episode")
    name = policy if isinstance(policy, str) else type(policy).__name__
    (made,) = named_policies(policy if isinstance(policy, str) else {name: policy}, scenario).values()
    heads, targets, estimates, energies = [], [], [], []
    for state, outcome in episodes(made, World(scenario, threads=1), [seed]):
        heads.append(int(state.network.row["head"][0]))
        targets.append(outcome.target_m[0].copy())
        estimates.append(outcome.estimate_m[0].copy())
        energies.append(float(outcome.energy_mj[0]))
    nodes, led = state.network.positions[0], sorted({head for head in heads if head >= 0})
    truth, believed = np.array(targets), np.array(estimates)
    rms_m = float(np.sqrt(np.mean(np.sum((truth - believed) ** 2, axis=1))))
    axes = axes_of(ax)
    axes.plot(*nodes.T, ".", color=GREY, markersize=5, label="nodes")
    axes.plot(*nodes[led].T, "s", color=BLUE, markersize=5, label="heads")
    axes.plot(*truth.T, color=DARK, linewidth=1.6, label="target")
    axes.plot(*believed.T, color=VERMILION, linewidth=1.0, marker=".", markersize=3, label="estimate")
    mean_mj = float(np.mean(energies))
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    axes.set_title(escape_label(f"{scenario.name}, {name}: RMS {rms_m:.3g} m, {mean_mj:.3g} mJ a time step"))
    axes.legend(frameon=False, loc="upper left", bbox_to_anchor=(1, 1))
    return axes
