"""What is claimed of the fingerprint system, what is expected of our reading, and how both are judged.

A difference counts when it exceeds two standard errors, paired by run.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from wsn_env.evaluation.intervals import Measured
from wsn_env.papers.claim import Claim, Expectation, judge_claim
from wsn_env.papers.grnn.comparison import LAST, PAIRS
from wsn_env.papers.grnn.flies import FLIES, FLIES_IN_M, GOLDEN, PAN, Search
from wsn_env.papers.grnn.systems import ANCHORS, COMPARED_S, FILTERS, METHODS, PERIODS_S, Results
from wsn_env.papers.rollout import Record, exceeds, pooled_rms

LONGER = slice(1, None)  # of PERIODS_S, those of .2 s and more
EXPECTED_RMSE_M = {  # from an independent implementation of our reading, at T = .1, .2, .5, 1 s
    "trilateration": (53.4, 53.6, 53.3, 55.0),
    "nonlinear_ls": (19.2, 19.2, 19.3, 19.4),
    "grnn": (16.7, 16.7, 16.7, 16.7),
    "grnn_kf": (5.2, 6.4, 8.7, 10.8),
    "ekf": (5.3, 6.7, 9.1, 11.8),
    "ukf": (5.3, 6.7, 9.2, 12.0),
    "ckf": (5.3, 6.7, 9.2, 12.1),
    "ickf": (5.4, 6.7, 9.2, 11.7),
}
SHARE, GRNN_SHARE = 0.10, 0.03  # tolerances of a root mean square error
EXPECTED_POOR_START_M = {("ring8", "ckf"): 11.7, ("ring8", "ickf"): 2.04, ("mix8", "ckf"): 34.4, ("mix8", "ickf"): 2.70}
EXPECTED_EQUAL_INFORMATION_M = {0.1: 5.5, 1.0: 4.5}  # CKF
EXPECTED_WIDTH_DB, WIDTH_DOUBT_DB = 3.70, 0.5  # another draw of map and validation points moves the width by .15
EXPECTED_VALIDATION_M, VALIDATION_DOUBT_M = 16.22, 1.3  # and the error at 400 points by .45
EXPECTED_BOUND_M = 16.8
EXPECTED_REFERENCE_M = {LAST: 48.5, PAIRS: 39.5}  # least squares by its reference anchor; the first: above
FLIES_SHARE = 0.001  # of the error: a swarm that comes so near has found the width
ITERATION_SHARE = 0.05  # with a good start iterating changes less


def list_expectations(results: Results, searches: list[Search], compared: dict[str, np.ndarray]) -> list[Expectation]:
    """Every expected figure.

    Args:
        searches: for the network's width.
        compared: method: (R, K) error in every period [m].
    """
    figures = []
    for method, row in EXPECTED_RMSE_M.items():
        share = GRNN_SHARE if method == "grnn" else SHARE
        for period_s, rms in zip(PERIODS_S, row, strict=True):
            measured, _ = results.method(method, period_s).pooled_rms_m()
            figures.append(Expectation(f"RMSE [m] of {method} at T = {period_s:g} s", rms, share * rms, measured))
    for (anchors, method), rms in EXPECTED_POOR_START_M.items():
        measured, _ = results.start(method, anchors, "field").pooled_rms_m()
        what = f"RMSE [m] of {method} in the first 5 s from the field's middle, {anchors}, 0.5 dB"
        figures.append(Expectation(what, rms, SHARE * rms, measured))
    for period_s in PERIODS_S:
        figures.append(
            Expectation(
                f"(ICKF - CKF) / CKF with a fix to begin with, T = {period_s:g} s",
                0.0,
                ITERATION_SHARE,
                _gain(results.method("ickf", period_s), results.method("ckf", period_s)),
            )
        )
    for period_s, rms in EXPECTED_EQUAL_INFORMATION_M.items():
        measured, _ = results.equal_information("ckf", period_s).pooled_rms_m()
        figures.append(
            Expectation(f"RMSE [m] of ckf at T = {period_s:g} s, noise sqrt(1 s / T) dB", rms, SHARE * rms, measured)
        )
    for name, rms in EXPECTED_REFERENCE_M.items():
        measured, _ = pooled_rms(compared[name] ** 2)
        figures.append(Expectation(f"RMSE [m] of {name}, T = {COMPARED_S:g} s", rms, SHARE * rms, measured))
    golden, pan = (next(s for s in searches if s.name == name) for name in (GOLDEN, PAN))
    width, error = float(golden.width_db[0]), float(golden.error_m[0])
    return figures + [
        Expectation("width [dB] by golden section", EXPECTED_WIDTH_DB, WIDTH_DOUBT_DB, width),
        Expectation("RMSE [m] at the validation points", EXPECTED_VALIDATION_M, VALIDATION_DOUBT_M, error),
        Expectation("evaluations of golden section", 16, 0, golden.evaluations),
        Expectation("width by fruit flies over that by golden section", 1.0, 0.02, float(pan.width_db[0]) / width),
        Expectation(
            "static Cramer-Rao bound [m] along the path, ring8", EXPECTED_BOUND_M, 0.1, results.bound_m["ring8"]
        ),
    ]


def judge_claims(results: Results, searches: list[Search]) -> list[Claim]:
    """Every claim, judged."""
    return [
        *_error_grows(results),
        _crossover(results),
        *_combination(results),
        *_iteration(results),
        _fruit_flies(searches),
    ]


def excess(ours: np.ndarray, theirs: np.ndarray) -> tuple[float, float]:
    """By what share their RMSE exceeds ours, and its standard error, from the runs' mean square errors (R,); paired."""
    ratio = Measured.root_ratio(theirs, ours)
    return ratio.value - 1, ratio.stderr


def mean_excess(ours: np.ndarray, theirs: np.ndarray) -> tuple[float, float]:
    """The same of the mean error, from that of the runs (R,)."""
    ratio = Measured.ratio(theirs, ours)
    return ratio.value - 1, ratio.stderr


def _run_mean(record: Record) -> np.ndarray:
    """(R,) mean error of each run [m]."""
    return np.sqrt(record.square_error()).mean(axis=1)


def _run_mse(record: Record) -> np.ndarray:
    """(R,) mean square error of each run [m^2]."""
    return record.rms_m() ** 2


def _gain(one: Record, other: Record) -> float:
    return one.pooled_rms_m()[0] / other.pooled_rms_m()[0] - 1


def _row(records: list[Record]) -> str:
    return ", ".join(f"{record.pooled_rms_m()[0]:.1f}" for record in records)


def _error_grows(results: Results) -> Iterator[Claim]:
    for method in ("grnn_kf", "ickf"):
        records = [results.method(method, t) for t in PERIODS_S]
        equal = [results.equal_information(method, t) for t in PERIODS_S]
        grows = [all(exceeds(_run_mse(b), _run_mse(a)) for a, b in zip(row, row[1:])) for row in (records, equal)]
        ours = f"{_row(records)} m at T = .1, .2, .5, 1 s; {_row(equal)} m where a second tells as much at any T"
        what = f"the error of {METHODS[method]} grows with the sampling period"
        yield Claim(what, "grows", ours, judge_claim(all(grows), grows[0]))


def _crossover(results: Results) -> Claim:
    """Whether one axis has the larger error below T = .5 s and the other above, for any filter."""
    crossed, shown = [], []
    for method in FILTERS:
        along = {t: [results.method(method, t).axis_rms_m(axis) ** 2 for axis in (0, 1)] for t in (0.2, 1.0)}
        for x, y in ((0, 1), (1, 0)):
            if exceeds(along[0.2][x], along[0.2][y]) and exceeds(along[1.0][y], along[1.0][x]):
                crossed.append(method)
        pairs = [[results.method(method, t).pooled_rms_m(axis)[0] for axis in (0, 1)] for t in PERIODS_S]
        shown.append(f"{METHODS[method]} " + " ".join(f"{x:.1f}/{y:.1f}" for x, y in pairs))
    ours = "x/y [m] at T = .1, .2, .5, 1 s: " + "; ".join(shown)
    good = len(crossed) == len(FILTERS)
    return Claim("the errors in x and y cross over at T = 0.5 s", "cross", ours, judge_claim(good, good))


def _combination(results: Results) -> Iterator[Claim]:
    """The fixes' filter against each of its parts: the network without a filter, the filter on bare strengths.

    The reading: periods of 0.2 s and more.
    """
    ours = [results.method("grnn_kf", t) for t in PERIODS_S]
    parts = {
        "GRNN alone": [results.method("grnn", t) for t in PERIODS_S],
        "ICKF alone (on the strengths, begun in the field's middle)": [results.unaided(t) for t in PERIODS_S],
        "ICKF on the strengths, begun with the network's fix": [results.method("ickf", t) for t in PERIODS_S],
    }
    for part, theirs in parts.items():
        wins = [exceeds(_run_mse(b), _run_mse(a)) for a, b in zip(ours, theirs, strict=True)]
        squares = ", ".join(_percent(*excess(_run_mse(a), _run_mse(b))) for a, b in zip(ours, theirs, strict=True))
        means = ", ".join(_percent(*mean_excess(_run_mean(a), _run_mean(b))) for a, b in zip(ours, theirs, strict=True))
        text = (
            f"GRNN + KF {_row(ours)} m at T = .1, .2, .5, 1 s; the other's RMSE is beyond that by {squares}, its mean"
            f" error by {means}"
        )
        what = f"the combination of network and filter beats {part}"
        yield Claim(what, "beats", text, judge_claim(all(wins), all(wins[LONGER])))


def _percent(share: float, error: float) -> str:
    return f"{100 * share:+.1f} ({100 * error:.1f}) %"


def _iteration(results: Results) -> Iterator[Claim]:
    for anchors in ANCHORS:
        poor, good = ([results.start(m, anchors, start) for m in ("ckf", "ickf")] for start in ("field", "fix"))
        better = [exceeds(_run_mse(ckf), _run_mse(ickf)) for ckf, ickf in (poor, good)]
        ours = (
            f"first 5 s, 0.5 dB: CKF {poor[0].pooled_rms_m()[0]:.2f}, ICKF {poor[1].pooled_rms_m()[0]:.2f} m from the"
            f" field's middle; {good[0].pooled_rms_m()[0]:.2f}, {good[1].pooled_rms_m()[0]:.2f} m from a fix"
        )
        large = _gain(good[1], good[0]) < -ITERATION_SHARE  # a gain that one would notice
        what = f"iteration improves the cubature filter, {anchors}"
        yield Claim(what, "improves", ours, judge_claim(all(better) and large, better[0]))


def _fruit_flies(searches: list[Search]) -> Claim:
    """Every swarm, in every draw, against golden section: the error, not the width, is what a search is for.

    The reading: the swarm of Pan (2012), which the text's name is of.
    """
    golden, *swarms = (next(s for s in searches if s.name == name) for name in (GOLDEN, PAN, FLIES, FLIES_IN_M))
    best = float(golden.error_m[0])
    found = [bool((swarm.error_m <= (1 + FLIES_SHARE) * best).all()) for swarm in swarms]
    text = "; ".join(f"{swarm.name}: {swarm.error_m.max():.2f} m in the worst draw" for swarm in swarms)
    ours = f"golden section {best:.2f} m; {text}"
    verdict = judge_claim(all(found), found[0])
    return Claim("fruit fly optimisation finds the network's best width", "finds it", ours, verdict)
