"""The paper's claims about energy, which it counts in nodes that transmit (ANTNP), and how they are judged."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from wsn_env.evaluation.intervals import Measured
from wsn_env.papers.binary.readings import even_period_s, transmitting_nodes
from wsn_env.papers.binary.results import Results
from wsn_env.papers.binary.systems import LIFETIMES, NODES, PERIODS_S, RADII_M, Setting, lifetime_trial, vary
from wsn_env.papers.claim import Claim, judge_claim
from wsn_env.papers.lifetimes import judge_lifetimes
from wsn_env.papers.rollout import SIGNIFICANT, exceeds, keeps_falling

STEADY_SHARE = 0.05  # a count that changes by less does not change


def judge_energy(results: Results) -> Iterator[Claim]:
    """Every claim about energy, judged."""
    yield _fewer_reports(results)
    yield _slow_against_steep(results, "number of nodes N", NODES, "nodes", (100, "100 nodes"))
    yield _slow_against_steep(results, "sensing radius R", RADII_M, "radius_m", (10.0, "10 m"))
    yield from _over_periods(results)


def _counts(results: Results, system: str, keyword: str, values: Sequence[float]) -> list[np.ndarray]:
    return [results.reporting(setting) for setting in vary(system, keyword, values)]


def _at_ends(counts: list[np.ndarray], between: str) -> str:
    """At the shortest and the longest sampling period."""
    return between.join(f"{Measured.mean(counts[k])} at {PERIODS_S[k]:g} s" for k in (0, -1))


def _fewer_reports(results: Results) -> Claim:
    nodes, energy = (
        [quantity(Setting(name)) for name in ("paper", "centroid")]
        for quantity in (results.reporting, results.energy_mj)
    )
    sweeps = (("nodes", NODES), ("radius_m", RADII_M), ("period_s", PERIODS_S))
    pairs = [
        pair
        for keyword, values in sweeps
        for pair in zip(*(_counts(results, name, keyword, values) for name in ("centroid", "paper")), strict=True)
    ]
    at_default = exceeds(nodes[1], nodes[0]) and exceeds(energy[1], energy[0])
    counts, costs = (" instead of ".join(str(Measured.mean(runs)) for runs in pair) for pair in (nodes, energy))
    ours = f"at T = 1 s {counts} nodes, {costs} mJ a period; more from T = {results.even_s()} s on"
    what = "fewer nodes transmit than with the centroid"
    return Claim(what, "fewer (a figure)", ours, judge_claim(all(exceeds(*pair) for pair in pairs), at_default))


def _slow_against_steep(
    results: Results, what: str, values: Sequence[float], keyword: str, step: tuple[float, str]
) -> Claim:
    """Plainly: the boundary's count grows by a smaller factor, too; under a reading: by fewer nodes a step."""
    settings = [vary(system, keyword, values) for system in ("paper", "centroid")]
    ends = [(results.reporting(row[0]), results.reporting(row[-1])) for row in settings]
    steps = (values[-1] - values[0]) / step[0]
    slopes = [(last - first) / steps for first, last in ends]

    def factor(system: int, runs: np.ndarray) -> float:
        return ends[system][1][runs].mean() / ends[system][0][runs].mean()

    factors = [Measured.bootstrap(partial(factor, system), results.runs) for system in (0, 1)]
    gap = Measured.bootstrap(lambda runs: factor(1, runs) - factor(0, runs), results.runs)
    laws = [transmitting_nodes(last) / transmitting_nodes(first) for first, *_, last in settings]
    more = " and ".join(str(Measured.mean(slope)) for slope in slopes)
    ours = (
        f"{more} nodes more with every {step[1]}; from {values[0]:g} to {values[-1]:g} by factors {factors[0]} and"
        f" {factors[1]} (closed forms {laws[0]:.2f} and {laws[1]:.2f})"
    )
    steeper = exceeds(slopes[1], slopes[0])
    claim = f"the transmitting nodes of the boundary method grow slowly with the {what}, the centroid's steeply"
    plainly = steeper and gap.value > SIGNIFICANT * gap.stderr
    return Claim(claim, "so (a figure)", ours, judge_claim(plainly, steeper))


def _over_periods(results: Results) -> Iterator[Claim]:
    boundary, centroid = (_counts(results, name, "period_s", PERIODS_S) for name in ("paper", "centroid"))
    grows = keeps_falling(boundary[::-1])
    ours = (
        f"from {_at_ends(boundary, ' to ')}; as many"
        f" as the centroid's at {results.even_s()} s (closed form {even_period_s():.2f} s)"
    )
    what = "the transmitting nodes of the boundary method grow with the sampling period T"
    yield Claim(what, "grow (a figure)", ours, judge_claim(grows, grows))
    change = Measured.mean(centroid[-1] - centroid[0])
    most = abs(change.value) + SIGNIFICANT * change.stderr
    still = abs(change.value) <= SIGNIFICANT * change.stderr and most < STEADY_SHARE * centroid[0].mean()
    ours = f"{_at_ends(centroid, ', ')}; paired change {change}"
    yield Claim(
        "the centroid's transmitting nodes do not depend on T", "constant (a figure)", ours, judge_claim(still, still)
    )


def judge_lifetime(results: Results) -> Claim:
    """How long the network lasts, which the paper does not measure."""
    what = "the network lasts longer with the boundary method than with the centroid"
    nodes = lifetime_trial(LIFETIMES[0], results.runs).scenario.field.nodes
    return judge_lifetimes(what, "no figure", "5 mJ", nodes, *(results.lifetimes[system] for system in LIFETIMES))
