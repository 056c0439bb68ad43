"""The picture of a comparison on recorded tracks."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wsn_env.bluetooth.recorded_evaluation import RecordedEvaluation
from wsn_env.envs.rendering.colours import BLUE, DARK, GREEN, ORANGE, PURPLE, SKY, VERMILION, YELLOW
from wsn_env.evaluation.comparison import stem_of
from wsn_env.reports.pictures import escape_label

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FAMILIES = (BLUE, ORANGE, GREEN, PURPLE, SKY, YELLOW)


def draw_recorded(evaluation: RecordedEvaluation) -> Figure:
    """Figure of RMS against energy: families as lines, single policies as points, one for each lam that matters."""
    from matplotlib.figure import Figure

    lams, policies = evaluation.first.lams, evaluation.first.policies
    lam = lams[0]
    stems = evaluation.first.families()
    figure = Figure(figsize=(8, 5.2), layout="constrained")
    axes = figure.subplots()
    colours = iter(FAMILIES)
    for stem in stems:
        members = evaluation.family(stem, lam)
        xs = [evaluation.mean(policy, lam, "energy_mj") for policy in members]
        ys = [evaluation.mean(policy, lam, "rms_m") for policy in members]
        axes.errorbar(
            xs,
            ys,
            yerr=[evaluation.spread(policy, lam, "rms_m") for policy in members],
            marker="o",
            markersize=4,
            linewidth=1.2,
            color=next(colours, DARK),
            label=escape_label(stem.rstrip(":=n")),
        )
    for k, policy in enumerate(policies):
        if stem_of(policy) not in stems:
            points = sorted(  # one, if it does not look at lam
                {(evaluation.mean(policy, each, "energy_mj"), evaluation.mean(policy, each, "rms_m")) for each in lams}
            )
            learned = policy.startswith("ppo")
            style = dict(marker="*", markersize=13, color=VERMILION) if learned else dict(marker="s", color=DARK)
            axes.plot(*zip(*points), linewidth=1.2, zorder=4 if learned else 3, **style)
            side = (6, 8) if k % 2 else (6, -13)
            axes.annotate(escape_label(policy), points[-1], xytext=side, textcoords="offset points", fontsize=9)
    axes.set_xlabel("energy [mJ per time step]")
    axes.set_ylabel("RMS error, mean over the tracks [m]")
    axes.set_title(escape_label(f"{evaluation.first.scenario.name}: {evaluation.description}"))
    axes.grid(alpha=0.3)
    if stems:
        axes.legend(frameon=False)
    return figure
