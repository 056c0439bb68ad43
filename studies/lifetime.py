"""How long networks last: heuristic and learned policies at fixed and at steered prices of energy, in Lifetime-v0.

    python -m studies.lifetime --out out/lifetime

The same episodes at every battery. Prices are in m/mJ; a fixed one is `budget:steering=0`.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro

from studies.tables import play
from wsn_env.envs.rendering.colours import LINES
from wsn_env.evaluation.files import replacing
from wsn_env.evaluation.intervals import Measured, Summary
from wsn_env.evaluation.progress import progress_bar
from wsn_env.reports.markdown import markdown_table
from wsn_env.scenario import Scenario

BATTERIES_MJ = (0.5, 1.0, 2.0, 4.0)
PRICES = (2, 4, 8, 16, 30)
RULES = {"greedy": "greedy", "ppo of PreDC-v0": "ppo:of=PreDC-v0"}
STEERED = {"greedy": "price=16,steering=1.4", "ppo of PreDC-v0": "price=8,steering=1"}  # by `find_price`
LEARNED = "ppo"


def _steered(label: str) -> str:
    """Of a rule at its steered price."""
    return f"{label}, {STEERED[label].replace('=', ' ').replace(',', ', ')}"


PLAIN = ("static_cluster", "pre_dc", "pre_dc:least_left=0.2", "nearest0", "nearest1", "nearest2")
RIVALS = {  # of the learned policy, each the best of its kind in hindsight, at every battery anew
    "best baseline that ignores energy prices": PLAIN,
    "greedy at its best fixed price": tuple(f"greedy, price {price}" for price in PRICES),
    "ppo of PreDC-v0 at its best fixed price": tuple(f"ppo of PreDC-v0, price {price}" for price in PRICES),
    "greedy at a steered price": (_steered("greedy"),),
    "pre_dc": ("pre_dc",),
}
SHOWN_MJ = 2.0  # of the table of all metrics


@dataclass
class Lifetimes:
    """How many episodes."""

    episodes: int = 200
    """At every battery."""
    out: Path = Path("out/lifetime")
    """Folder."""


def policies() -> dict[str, str]:
    """Names of policies by label."""
    named = {name: name for name in PLAIN}
    for label, rule in RULES.items():
        named |= {f"{label}, price {price}": f"budget:rule={rule},price={price},steering=0" for price in PRICES}
        named[_steered(label)] = f"budget:rule={rule},{STEERED[label]}"
    return named | {LEARNED: LEARNED}


def main(arguments: list[str] | None = None) -> int:
    """Play, print and write batteries.md, learned.md, metrics.md and errors.png."""
    asked = tyro.cli(Lifetimes, args=arguments, description=__doc__)
    asked.out.mkdir(parents=True, exist_ok=True)
    errors, metrics, played, named = [], [], {}, policies()
    with progress_bar() as report:
        for number, (label, policy) in enumerate(named.items()):
            found = {}
            for battery_mj in BATTERIES_MJ:
                report(number, len(named), f"{label}, {battery_mj:g} mJ")
                scenario = Scenario.named("Lifetime-v0", battery_j=battery_mj / 1e3)
                found[battery_mj] = play(scenario, policy, asked.episodes)
            played[label] = {battery_mj: each["error_m"] for battery_mj, each in found.items()}
            errors.append([label, *(str(Measured.mean(each["error_m"])) for each in found.values())])
            shown = found[SHOWN_MJ]
            periods = (str(Measured.mean(shown[name])) for name in ("first_death", "half_dead", "functional"))
            share = f"{100 * shown['tracked'].mean():.1f}"
            left = f"{shown['stranded_mj'].mean():.0f}", f"{shown['stranded_sd'].mean():.2f}"
            metrics.append([label, str(Measured.mean(shown["error_m"])), *periods, share, *left])
    columns = [
        *("first death, step", "half dead, step", "functional lifetime, steps"),
        *("error <= radius, %", "energy left, mJ", "sd of battery shares left"),
    ]
    batteries = [f"{each:g} mJ" for each in BATTERIES_MJ]
    tables = {
        "batteries": markdown_table(["capped error m", *batteries], errors),
        "learned": markdown_table(["ppo's error is smaller than that of", *batteries], compare_learned(played)),
        "metrics": markdown_table([f"{SHOWN_MJ:g} mJ a node", "capped error m", *columns], metrics),
    }
    for name, text in tables.items():
        with replacing(asked.out / f"{name}.md") as path:
            path.write_text(text, encoding="utf-8")
        print(text)
    means = {label: [each.mean() for each in found.values()] for label, found in played.items()}
    draw_errors(means, asked.out / "errors.png")
    return 0


def draw_errors(means: dict[str, list[float]], path: Path) -> None:
    """Picture: error over battery, of the learned policy, of greedy at its prices and of two baselines.

    Args:
        means: capped error at each of BATTERIES_MJ [m], by label.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    fixed = np.min([means[label] for label in RIVALS["greedy at its best fixed price"]], axis=0)
    lines = {
        "pre_dc": means["pre_dc"],
        "nearest0": means["nearest0"],
        "greedy at its best fixed price, in hindsight": fixed,
        f"budget ({_steered('greedy')})": means[_steered("greedy")],
        LEARNED: means[LEARNED],
    }
    figure, panel = plt.subplots(figsize=(7, 4.2), layout="constrained")
    for (label, errors), colour in zip(lines.items(), LINES):
        panel.plot(BATTERIES_MJ, errors, "o-", color=colour, ms=4, lw=1.5, label=label)
    panel.set(xscale="log", yscale="log", xlabel="battery of a node [mJ]", ylabel="mean capped error [m]")
    panel.set_xticks(BATTERIES_MJ, [f"{each:g}" for each in BATTERIES_MJ])
    panel.set_yticks([1, 2, 5, 10, 15], ["1", "2", "5", "10", "15"])
    panel.minorticks_off()
    panel.grid(alpha=0.3, linewidth=0.5)
    panel.legend(frameon=False)
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=120, format="png")
    plt.close(figure)


def compare_learned(played: dict[str, dict[float, np.ndarray]]) -> list[list[str]]:
    """How much smaller the learned policy's mean error is than each rival's [%], with 95 % intervals of pairs.

    Args:
        played: errors (episodes,) [m] by label and battery [mJ].
    """
    rows = []
    for name, labels in RIVALS.items():
        cells = []
        for battery_mj in BATTERIES_MJ:
            best = min(labels, key=lambda label: played[label][battery_mj].mean())
            rival = played[best][battery_mj]
            saved = Summary.of(100 * (rival - played[LEARNED][battery_mj]) / rival.mean())
            which = "" if len(labels) == 1 else f", {best.removeprefix('greedy, ').removeprefix('ppo of PreDC-v0, ')}"
            cells.append(f"{saved.mean:.1f} % ({saved.low:.1f} to {saved.high:.1f}{which})")
        rows.append([name, *cells])
    return rows


if __name__ == "__main__":
    sys.exit(main())
