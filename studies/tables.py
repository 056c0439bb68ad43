"""Small tables of the pages, each from a few evaluations of rules and of the policies that come with the package.

    python -m studies.tables --out out/tables
    python -m studies.tables --only honesty --episodes 50

Every figure stands with its standard error over the episodes.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
import tyro

from studies.seeds import best_of, format_advantage
from wsn_env.evaluation.comparison import evaluate
from wsn_env.evaluation.files import replacing
from wsn_env.evaluation.intervals import Measured
from wsn_env.evaluation.policies import make_policy
from wsn_env.evaluation.progress import progress_bar
from wsn_env.evaluation.rollout import BLOCK, evaluation_seeds, rollout
from wsn_env.reports.markdown import markdown_table
from wsn_env.scenario import Scenario
from wsn_env.simulation.world import World

Rows = Iterable[list[str]]
COSTLY = {  # the most expensive competitive policy of each scenario
    "PreDC-v0": "static_cluster",
    "Rssi-v0": "static_cluster",
    "Binary-v0": "boundary",
    "Anchors-v0": "static_cluster",
    "Underwater-v0": "strongest_signal",
    "Ble-v0": "all",
}
HONESTY = (  # scenario, policy, what is changed, what that shows
    ("PreDC-v0", "nearest3", "", "modes of motion, for a target that may turn"),
    ("PreDC-v0", "nearest3", "filter_q=0.05", "the filter's q is twice the track's, 0.05 against 0.025 m/s²"),
    ("PreDC-v0", "nearest3", "filter_q=0.025", "with the track's own q it is consistent"),
    ("PreDC-v0", "nearest3", "fusion=pooled filter_q=0.025", "pooling weighs each member's share of particles apart"),
    ("Rssi-v0", "informed3", "", "modes of motion, for a target that may turn"),
    ("Rssi-v0", "informed3", "filter_q=0.05", "the filter's q is twice the track's, 0.05 against 0.025 m/s²"),
    ("Rssi-v0", "informed3", "filter_q=0.025", "with the track's own q; a lost track now and then"),
    ("Anchors-v0", "nearest3", "", "modes of motion"),
    ("Anchors-v0", "nearest3", "filter_q=1", "q is twice the track's, 1 against 0.5 m/s²"),
    ("Anchors-v0", "nearest3", "filter_q=0.5", "with the track's own q it is consistent"),
    ("Binary-v0", "boundary", "", "an edge of 1 m is believed where there is none"),
    ("Binary-v0", "boundary", "edge_m=0.3", "with a sharper edge particles run short now and then"),
    ("Binary-v0", "informed3", "", "an edge of 1 m is believed where there is none"),
    ("Binary-v0", "informed3", "filter_q=0.3", "the same, with q three times the track's"),
    ("Underwater-v0", "strongest_signal", "", "spread copies widen the cloud"),
    ("Underwater-v0", "strongest_signal", "resampling=systematic", "repeated copies let it collapse: overconfident"),
    ("Ble-v0", "informed3", "", "a level's likelihood counts with an exponent of 0.7, for recorded rooms"),
    ("Ble-v0", "informed3", "temper=1", "with an exponent of 1 most of it is gone"),
)

MOTIONS = {  # what a filter may have to follow, in PreDC-v0
    "crossing": "",
    "straight": "motion=straight",
    "sine": "motion=sine",
    "circle": "motion=circle",
    "turns of up to 90°": "motion=turns",
    "waypoints": "motion=waypoint",
    "walk": "motion=walk",
    "crossing, with a stop": "faults=stops",
}
GREEDY = {"`greedy`, tuned for each lam": "greedy"}  # rivals of the policy that comes with the package
NEAREST = {"`adaptive`, tuned for each lam": "adaptive"} | GREEDY | {"`pre_dc`": "pre_dc"}
INFORMED = {"`adaptive_informed`, tuned for each lam": "adaptive_informed"} | GREEDY
FIXED_Q = (0.0125, 0.025, 0.05, 0.1, 0.2, 0.4)  # m/s^2
MANOEUVRE_Q = 0.6
LOST_M = 20.0  # an episode's RMS counts as this at most


@dataclass
class Tables:
    """Which tables, from how many episodes."""

    only: list[str] = field(default_factory=list)
    """Names; left out: all."""
    episodes: int | None = None
    """Of each cell; left out: 400, and 1,000 where percents are compared."""
    out: Path = Path("out/tables")
    """Folder."""


def play(scenario: Scenario, policy: str, episodes: int | None) -> dict[str, np.ndarray]:
    """Columns of an evaluation's first episodes."""
    episodes = episodes or 400
    made, world, seeds = make_policy(policy, scenario), World(scenario), evaluation_seeds(0, episodes)
    rows = [row for first in range(0, episodes, BLOCK) for row in rollout(made, world, seeds[first : first + BLOCK])]
    return {column: np.array([row[column] for row in rows]) for column in rows[0]}


def scenario_of(name: str, settings: str = "") -> Scenario:
    """A preset with changes as on the command line, at its middle lam."""
    from wsn_env.scenario.options import make_scenario

    scenario = make_scenario(name, settings.split(), [])
    return scenario if not isinstance(scenario.lam, tuple) else scenario.override(lam=scenario.lam_octaves[2])


def reference_points(episodes: int | None) -> tuple[list[str], Rows]:
    """The reference point of each scenario beside what it was chosen by."""
    columns = ["scenario", "`reference_error_m`", "error of the head alone (nearest0) m", "`reference_energy_mj`"]
    rows = []
    for name, costly in COSTLY.items():
        scenario = scenario_of(name)
        alone, dear = play(scenario, "nearest0", episodes), play(scenario, costly, episodes)
        points = f"{scenario.reference_error_m:g}", f"{scenario.reference_energy_mj:g}"
        energy = f"{Measured.mean(dear['energy_mj'])}, {costly}"
        rows.append([name, points[0], str(Measured.mean(alone["error_m"])), points[1], energy])
    return [*columns, "energy of the most expensive competitive policy mJ"], rows


def honesty(episodes: int | None) -> tuple[list[str], Rows]:
    """Whether filters expect the error that they have."""
    rows = []
    for name, policy, settings, why in HONESTY:
        found = play(scenario_of(name, settings), policy, episodes)
        ratios = (str(Measured.mean(found[column])) for column in ("anees", "variance_ratio"))
        what = f"{name}, {policy}" + (f", {settings}" if settings else "")
        rows.append([what, *ratios, str(Measured.root_mean(found["rms_m"] ** 2)), why])
    return ["scenario, policy, changes", "ANEES", "e² / trace", "RMS m", "why"], rows


def silence(episodes: int | None) -> tuple[list[str], Rows]:
    """What it is worth to weigh particles by who kept silent."""
    rows = []
    for name in ("PreDC-v0", "Rssi-v0"):
        squares = [
            play(scenario_of(name, f"silent_information={told}"), "nearest3", episodes)["rms_m"] ** 2
            for told in (False, True)
        ]
        rows.append([name, *(str(Measured.root_mean(each)) for each in squares)])
    return ["nearest3", "RMS m, the values alone", "RMS m, also who reported"], rows


def motions(episodes: int | None) -> tuple[list[str], Rows]:
    """A filter of fixed process noise against one whose target switches between modes, however the target moves."""
    rows = []
    for motion, changes in MOTIONS.items():
        cells, square = [], {}
        for q in (*FIXED_Q, None):
            settings = f"filter_q={q}" if q is not None else f"manoeuvre_q={MANOEUVRE_Q}"
            found = play(scenario_of("PreDC-v0", f"{changes} {settings}"), "nearest4", episodes or 200)
            square[q] = np.minimum(found["rms_m"], LOST_M) ** 2
            cells.append(str(Measured.root_mean(square[q])))
        best = min(FIXED_Q, key=lambda q: square[q].mean())
        cells[FIXED_Q.index(best)] = f"**{cells[FIXED_Q.index(best)]}**"
        over = np.sqrt(square[None].mean() / square[best].mean())
        rows.append([motion, *cells, f"{over:.2f}", str(Measured.mean(found["anees"]))])
    columns = [*(f"q = {q:g}" for q in FIXED_Q), "modes", "over the best q", "ANEES"]
    return ["RMS m", *columns], rows


def anchors(episodes: int | None) -> tuple[list[str], Rows]:
    """What few anchors tell."""
    rows = []
    for policy in ("nearest1", "informed1", "informed3", "all"):
        found = play(scenario_of("Anchors-v0"), policy, episodes)
        rows.append([policy, str(Measured.root_mean(found["rms_m"] ** 2)), str(Measured.mean(found["energy_mj"]))])
    return ["Anchors-v0", "RMS m", "energy mJ a time step"], rows


def shipped(name: str, episodes: int | None, rules: tuple[str, ...] = (), family: str = "") -> tuple[list[str], Rows]:
    """Returns of the policy that comes with the package, of rules, and of the best of a family in hindsight."""
    scenario, sizes = Scenario.named(name), [f"{family}{n}" for n in range(9)] if family else []
    lams = scenario.lam_octaves
    found = evaluate(["ppo", *rules, *sizes], scenario, lams, episodes or 1000)
    shown = {"ppo": dict.fromkeys(lams, "ppo")}
    if family:
        shown[f"{family}0..8, the best at each lam"] = {lam: best_of(found, sizes, lam) for lam in lams}
    shown |= {rule: dict.fromkeys(lams, rule) for rule in rules}
    rows = [
        [label, *(str(Measured.mean(found.values(policy, lam, "return"))) for lam, policy in of_lam.items())]
        for label, of_lam in shown.items()
    ]
    return ["lam m/mJ", *(f"{lam:g}" for lam in lams)], rows


def comparison(name: str, episodes: int | None, family: str, others: dict[str, str]) -> tuple[list[str], Rows]:
    """The policy that comes with the package beside rules, and what it is ahead of them in percent."""
    scenario, sizes = Scenario.named(name), [f"{family}{n}" for n in range(9)]
    lams = scenario.lam_octaves[1::2]
    found = evaluate(["ppo", *sizes, *others.values()], scenario, lams, episodes or 1000)
    rows = [["**`ppo`**", *(f"**{found.values('ppo', lam, 'return').mean():.1f}**" for lam in lams)]]
    best = {lam: best_of(found, sizes, lam) for lam in lams}
    for label, rule in {f"`{family}0..8`, the best at each lam": "", **others}.items():
        cells = []
        for lam in lams:
            rival = rule or best[lam]
            theirs = str(Measured.mean(found.values(rival, lam, "return")))
            cells.append(f"{theirs}: {format_advantage(found, ['ppo'], rival, lam)}")
        rows.append([label, *cells])
    return [name, *(f"lam = {lam:g}" for lam in lams)], rows


def references(episodes: int | None) -> tuple[list[str], Rows]:
    """How near to the Cramer-Rao reference the usual filter comes, at lam = 4."""
    names, rows = ("ppo", "greedy", "adaptive", "nearest2"), []
    for scenario in ("PreDC-v0", "Rssi-v0"):
        found = evaluate(names, Scenario.named(scenario), [4.0], episodes or 400)
        ratios = [found.rms_over_reference(name, 4.0) for name in names]
        rows.append([scenario, *(f"{ratio.mean:.2f} [{ratio.low:.2f}, {ratio.high:.2f}]" for ratio in ratios)])
    return ["RMS / reference, lam = 4", *names], rows


TABLES: dict[str, Callable[[int | None], tuple[list[str], Rows]]] = {
    "reference_points": reference_points,
    "honesty": honesty,
    "silence": silence,
    "motions": motions,
    "anchors": anchors,
    "references": references,
    "comparison_PreDC-v0": partial(comparison, "PreDC-v0", family="nearest", others=NEAREST),
    "comparison_Rssi-v0": partial(comparison, "Rssi-v0", family="nearest", others=NEAREST),
    "comparison_Binary-v0": partial(
        comparison,
        "Binary-v0",
        family="informed",
        others=INFORMED | {"`boundary`": "boundary", "`pre_dc`": "pre_dc"},
    ),
    "comparison_Anchors-v0": partial(
        comparison,
        "Anchors-v0",
        family="informed",
        others=INFORMED | {"`nearest2`": "nearest2"},
    ),
    "comparison_Underwater-v0": partial(
        comparison,
        "Underwater-v0",
        family="informed",
        others=INFORMED | {"`strongest_signal`": "strongest_signal", "`pre_dc`": "pre_dc"},
    ),
    "shipped_PreDC-v0": partial(shipped, "PreDC-v0"),
    "shipped_Rssi-v0": partial(shipped, "Rssi-v0"),
    "shipped_Binary-v0": partial(shipped, "Binary-v0"),
    "shipped_Anchors-v0": partial(shipped, "Anchors-v0"),
    "shipped_Underwater-v0": partial(shipped, "Underwater-v0"),
    "shipped_Ble-v0": partial(shipped, "Ble-v0", rules=("greedy", "all"), family="informed"),
}


def main(arguments: list[str] | None = None) -> int:
    """Make, print and write NAME.md."""
    asked = tyro.cli(Tables, args=arguments, description=__doc__)
    unknown = [name for name in asked.only if name not in TABLES]
    if unknown:
        print(f"tables: only = {unknown}: unknown; allowed are {', '.join(TABLES)}", file=sys.stderr)
        return 2
    asked.out.mkdir(parents=True, exist_ok=True)
    names = asked.only or list(TABLES)
    with progress_bar() as report:
        for i, name in enumerate(names):
            report(i, len(names), name)
            columns, rows = TABLES[name](asked.episodes)
            left = [k for k, column in enumerate(columns) if k == 0 or column == "why"]
            text = markdown_table(columns, rows, left)
            with replacing(asked.out / f"{name}.md") as path:
                path.write_text(text, encoding="utf-8")
            print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
