"""What single episodes tell: histograms of a few, and the first policy's worst one to play."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from wsn_env.envs.rendering.colours import LINES
from wsn_env.evaluation.comparison import Evaluation
from wsn_env.evaluation.policies import Policy
from wsn_env.evaluation.progress import Progress
from wsn_env.evaluation.rollout import episodes, evaluation_seeds
from wsn_env.reports.pages.page import image, section
from wsn_env.reports.pages.recording import record
from wsn_env.reports.pages.replay_page import player_html
from wsn_env.reports.pictures import escape_label
from wsn_env.scenario import Scenario
from wsn_env.simulation.world import World

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN = 4  # policies in the histograms
LOOKED_AT = 20  # episodes of the histograms
Played = dict[str, tuple[np.ndarray, np.ndarray]]  # by policy: every period's error [m] and nodes awake


def sample_sections(evaluation: Evaluation, policies: dict[str, Policy], progress: Progress | None = None) -> list[str]:
    """Histograms of the first policy and the best of the others, and its worst episode beside the best of them.

    Args:
        evaluation: drawn at its middle lam.
        policies: its policies by name.
        progress: called with (periods played, of, what).
    """
    lam = evaluation.middle_lam
    scenario = evaluation.scenario.override(lam=lam)
    first = evaluation.policies[0]
    others = [policy for policy in evaluation.ranked(lam) if policy != first]
    seeds = evaluation_seeds(evaluation.seed, evaluation.episodes)
    returns = evaluation.values(first, lam, "return")
    worst = int(returns.argmin())
    beside = {policy: policies[policy] for policy in [first, *others[:1]]}
    shown = {policy: policies[policy] for policy in [first, *others][:SHOWN]}
    looked_at = seeds[:LOOKED_AT]
    figure = _draw_histograms(_play_episodes(shown, scenario, looked_at, progress))
    return [
        section(
            "Errors and cluster sizes",
            f"<p>Every time step of the first {len(looked_at)} episodes, lam = {lam:g} m/mJ.</p>",
            image(figure, "histograms of errors and of cluster sizes"),
        ),
        section(
            f"The worst episode of {first}",
            f"<p>Seed {seeds[worst]}, lam = {lam:g} m/mJ, return {returns[worst]:.1f} (mean {returns.mean():.1f})."
            " Click it, then space plays and arrows step.</p>",
            player_html(record(beside, scenario, seeds[worst])),
        ),
    ]


def _play_episodes(
    policies: dict[str, Policy], scenario: Scenario, seeds: Sequence[int], progress: Progress | None
) -> Played:
    """By policy, every period's error and how many nodes were awake."""
    world = World(scenario)
    played: Played = {}
    for number, (name, policy) in enumerate(policies.items()):
        periods = []
        for period, (_, outcome) in enumerate(episodes(policy, world, seeds), 1):
            periods.append((outcome.error_m.copy(), outcome.members.copy()))
            if progress:
                done = number * scenario.periods + period
                progress(done, len(policies) * scenario.periods, f"report: {name}")
        errors, awake = zip(*periods)
        played[name] = np.concatenate(errors), np.concatenate(awake)
    return played


def _draw_histograms(played: Played) -> Figure:
    """Shares of periods, by error and by how many nodes were awake."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 3.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    most, largest = (np.quantile(np.concatenate(values), 0.99) for values in zip(*played.values()))
    edges, sizes = np.linspace(0.0, most, 41), np.arange(int(largest) + 3) - 0.5
    for (name, (errors, awake)), colour in zip(played.items(), LINES):
        share = np.histogram(np.minimum(errors, most), edges)[0] / len(errors)
        left.stairs(100 * share, edges, color=colour, label=escape_label(name), linewidth=1.5)
        share = np.histogram(np.minimum(awake, sizes[-2] + 0.5), sizes)[0] / len(awake)
        right.stairs(100 * share, sizes, color=colour, label=escape_label(name), linewidth=1.5)
    left.set(xlabel="error [m]; last: and more", ylabel="periods [%]")
    right.set(xlabel="nodes awake; last: and more", ylabel="periods [%]")
    right.xaxis.get_major_locator().set_params(integer=True)
    left.legend(frameon=False)
    return figure
