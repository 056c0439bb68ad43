"""What Zhou, Cheng & Xing (2009) claim, and how it is judged.

A difference counts when it exceeds two standard errors over the runs; differences between systems are paired.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from wsn_env.evaluation.intervals import Measured
from wsn_env.papers.binary.energy import judge_energy, judge_lifetime
from wsn_env.papers.binary.results import Results
from wsn_env.papers.binary.study import Study
from wsn_env.papers.binary.systems import NODES, PERIODS_S, RADII_M, Setting, vary
from wsn_env.papers.claim import HOLDS, NOT_REPRODUCED, Claim, judge_claim
from wsn_env.papers.rollout import exceeds, keeps_falling

CROSSING_S = 3.5  # the paper's
NEAR_S = 0.5  # and what counts as the same


def judge_claims(study: Study) -> list[Claim]:
    """Every claim, judged."""
    results = study.results
    return [
        _lower_error(results),
        *_sweep_claims(results),
        *judge_energy(results),
        judge_lifetime(results),
        *_crossing(results),
        _printed(study),
    ]


def _lower_error(results: Results) -> Claim:
    errors = {name: results.run_error_m(Setting(name)) for name in ("raw", "paper", "mid", "centroid", "centroid_rls")}
    holds = all(exceeds(errors["centroid"], errors[name]) for name in ("raw", "paper", "mid"))
    holds &= exceeds(errors["centroid_rls"], errors["paper"])
    what = "boundary nodes locate the target better than the centroid of all that detect"
    return Claim(what, "better (a figure)", _means(errors), judge_claim(holds, holds))


def _sweep_claims(results: Results) -> Iterator[Claim]:
    for what, values, keyword in (("nodes", NODES, "nodes"), ("range R", RADII_M, "radius_m")):
        errors = {
            name: [results.run_error_m(setting) for setting in vary(name, keyword, values)]
            for name in ("raw", "paper", "centroid")
        }
        ours = "; ".join(f"{name} {_row(runs)}" for name, runs in errors.items()) + " m"
        falls = [keeps_falling(errors[name]) for name in ("paper", "raw")]
        claim = f"the error of the boundary method falls as the {what} grow{'s' if keyword == 'radius_m' else ''}"
        yield Claim(claim, "falls (a figure)", ours, judge_claim(all(falls), falls[1]))
        if keyword == "radius_m":
            first, *_, last = errors["centroid"]
            grows = exceeds(last, first)
            ours = f"centroid {_row(errors['centroid'])} m"
            claim = "the centroid degrades as the range R grows"
            yield Claim(claim, "grows (a figure)", ours, judge_claim(grows, grows))


def _crossing(results: Results) -> Iterator[Claim]:
    paper, inside, raw = (results.crossing_s(name) for name in ("paper", "paper_inside", "raw"))
    near, near_inside = (abs(crossing.value - CROSSING_S) <= NEAR_S for crossing in (paper, inside))
    ours = f"{_seconds(paper)} when it starts at the edge, {_seconds(inside)} when inside; v given: {_seconds(raw)}"
    what = "with T above 3.5 s the centroid is better than the paper's filter"
    yield Claim(what, f"{CROSSING_S} s", ours, judge_claim(near and near_inside, near))
    first, last = (results.mean_m(Setting("raw", period_s=t)) for t in (PERIODS_S[0], PERIODS_S[-1]))
    centroid = results.mean_m(Setting("centroid", period_s=PERIODS_S[-1]))
    its_fault = abs(raw.value - CROSSING_S) <= NEAR_S
    ours = (
        f"they blur, but with v given their mean error, {first} m at {PERIODS_S[0]:g} s and {last} m at"
        f" {PERIODS_S[-1]:g} s, stays below the centroid's {centroid} m, and the RMS crosses {_seconds(raw)}; it is the"
        " velocity, learnt from rest through the fixes that it shifts, that has too few periods before the steady part"
    )
    what = "the crossing comes from the fixes, which long periods blur"
    yield Claim(what, "so explained", ours, HOLDS if its_fault else NOT_REPRODUCED)


def _printed(study: Study) -> Claim:
    rms, mended = study.printed_rms_m(), study.results.rms_m(Setting("paper"))
    holds = rms.value < 2 * mended.value
    ours = f"RMS {rms} m: the velocity is never learnt; with P = F P F' first {mended} m"
    return Claim("the recursion of eqs. 12-13 as printed follows the target", "yes", ours, judge_claim(holds, holds))


def _means(errors: dict[str, np.ndarray]) -> str:
    return "mean error " + ", ".join(f"{name} {Measured.mean(runs)}" for name, runs in errors.items()) + " m"


def _row(runs: list[np.ndarray]) -> str:
    return ", ".join(str(Measured.mean(values)) for values in runs)


def _seconds(crossing: Measured) -> str:
    return f"at {crossing} s" if np.isfinite(crossing.value) else f"nowhere up to {PERIODS_S[-1]:g} s"
