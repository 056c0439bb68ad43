"""What the patent claims or our notes expect of the underwater system, and how it is judged from the figures measured.

A difference counts when it exceeds two standard errors, paired where both have played the same runs. An expected error
comes from an independent implementation's 100 runs, whose own noise is about ours: it is met within three standard
errors of the difference.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from wsn_env.models.acoustics import absorption_db_per_km
from wsn_env.models.state import PURPOSES
from wsn_env.papers.claim import Claim, Expectation, judge_claim
from wsn_env.papers.rollout import Record, exceeds, standard_error
from wsn_env.papers.underwater.systems import (
    HYSTERESES_DB,
    PARTICLES,
    RESAMPLINGS,
    ROUGH,
    SMOOTH,
    THRESHOLDS_DB,
    Results,
    lost,
    median_rms_m,
)
from wsn_env.scenario import Scenario

MET = 3 * sqrt(2)  # standard errors of one of two figures that are equally noisy
LOSES, KEEPS = 0.15, 0.03  # shares of lost runs
HARMLESS = (0.88, 1.08)  # ratio of two errors
ABSORPTION = ((10.0, 1.187), (20.0, 4.134), (50.0, 17.47))  # kHz, dB/km
RADIUS = ((80.0, 429.0), (85.0, 207.0), (88.0, 132.0), (92.0, 72.0))  # dB, m (whole metres, rounded down)
SHARE_LOST = {  # (noise, particles, handover): with systematic resampling, spread
    (SMOOTH, 100, "carried"): (0.62, 0.05),
    (SMOOTH, 100, "redrawn"): (0.19, 0.01),
    (SMOOTH, 300, "carried"): (0.28, 0.0),
    (SMOOTH, 300, "redrawn"): (0.04, 0.0),
    (ROUGH, 100, "carried"): (0.01, 0.0),
    (ROUGH, 100, "redrawn"): (0.0, 0.0),
    (ROUGH, 300, "carried"): (0.0, 0.0),
    (ROUGH, 300, "redrawn"): (0.0, 0.0),
}
RMSE_M = {
    (SMOOTH, 300, "carried"): (78.4, 16.0),
    (SMOOTH, 300, "redrawn"): (33.7, 15.8),
    (ROUGH, 300, "carried"): (24.9, 24.5),
    (ROUGH, 300, "redrawn"): (23.7, 23.8),
}
MEDIAN_M = {  # with 100 particles one run in a hundred moves the RMSE by a quarter: the median of the runs' RMS
    (SMOOTH, 100, "carried"): (79.1, 17.4),
    (SMOOTH, 100, "redrawn"): (21.8, 15.7),
    (ROUGH, 100, "carried"): (24.1, 23.2),
    (ROUGH, 100, "redrawn"): (24.4, 21.9),
}
THRESHOLD = {  # (threshold, silent): RMSE [m]
    (80.0, False): 15.94,
    (80.0, True): 15.29,
    (85.0, False): 17.55,
    (85.0, True): 15.74,
    (88.0, False): 18.88,
    (88.0, True): 16.53,
    (92.0, False): 24.76,
    (92.0, True): 21.21,
}
KNEE_DB = 88.0
ENERGY_J = {"sensing": 0.76, "handover": 0.28, "report": 0.97, "broadcast": 0.088}  # a period at 85 dB, no hysteresis


def list_expectations(results: Results) -> list[Expectation]:
    """Every expected figure."""
    figures = [
        Expectation(f"absorption at {khz:g} kHz [dB/km]", alpha, 0.01, absorption_db_per_km(khz))
        for khz, alpha in ABSORPTION
    ]
    figures += [
        Expectation(f"range at {db:g} dB [m]", metres, 1.0, Scenario.named("Underwater-v0", threshold_db=db).radius_m)
        for db, metres in RADIUS
    ]
    for cell, shares in SHARE_LOST.items():
        for record, share, what in zip(_pair(results, *cell), shares, _names(*cell), strict=True):
            tolerance = max(KEEPS, MET * sqrt(share * (1 - share) / results.runs))
            figures.append(Expectation(f"share lost: {what}", share, tolerance, float(lost(record).mean())))
    for statistic, table, measure in (("RMSE", RMSE_M, Record.pooled_rms_m), ("median RMS", MEDIAN_M, median_rms_m)):
        for cell, metres in table.items():
            for record, value, what in zip(_pair(results, *cell), metres, _names(*cell), strict=True):
                figures.append(_error(f"{statistic} [m]: {what}", value, *measure(record)))
    low, high = HARMLESS
    middle, half = (low + high) / 2, (high - low) / 2
    ratio = _rmse_ratio(results, ROUGH, 300, "carried")
    figures.append(
        Expectation("RMSE of spread over systematic, noise 0.03, 300 particles carried", middle, half, ratio)
    )
    for (threshold_db, silent), rmse in THRESHOLD.items():
        what = f"RMSE [m] at {threshold_db:g} dB, silence {'told' if silent else 'ignored'}"
        figures.append(_error(what, rmse, *results.threshold(threshold_db, silent).pooled_rms_m()))
    hasty, calm = (results.hysteresis(db) for db in (0.0, 3.0))
    ratio = float(calm.handover.mean() / hasty.handover.mean())
    figures.append(Expectation("handovers with 3 dB of hysteresis over those without", 0.5, 0.1, ratio))
    spent = energy_j(results.threshold(85.0, False))
    for purpose, joules in ENERGY_J.items():
        figures.append(Expectation(f"energy a period for {purpose} at 85 dB [J]", joules, 0.1 * joules, spent[purpose]))
    return figures


def _error(what: str, metres: float, measured: float, doubt: float) -> Expectation:
    return Expectation(what, metres, MET * doubt, measured)


def _names(noise: float, particles: int, handover: str) -> list[str]:
    return [f"noise {noise:g} m^2/s^3, {particles} particles {handover}, {name}" for name in RESAMPLINGS]


def energy_j(record: Record) -> dict[str, float]:
    """Mean energy of a period by purpose [J]."""
    return dict(zip(PURPOSES, (record.purposes_mj.mean(axis=(0, 1)) / 1e3).tolist(), strict=True))


def judge_claims(results: Results) -> list[Claim]:
    """Every claim, judged."""
    return [
        _keeps_the_target(results),
        _lowers_the_error(results),
        _does_no_harm(results),
        _handover_regularises(results),
        _silence(results),
        _thresholds_save(results),
        _knee(results),
        _hysteresis(results),
    ]


def _pair(results: Results, noise: float, particles: int, handover: str) -> list[Record]:
    return [results.resampling(noise, particles, handover, name) for name in RESAMPLINGS]


def _rmse_ratio(results: Results, noise: float, particles: int, handover: str) -> float:
    systematic, spread = _pair(results, noise, particles, handover)
    return spread.pooled_rms_m()[0] / systematic.pooled_rms_m()[0]


def _rms_text(record: Record) -> str:
    return f"{record.pooled_rms_m()[0]:.1f} m, {100 * lost(record).mean():.0f} % lost"


def _keeps_the_target(results: Results) -> Claim:
    parts, good = [], {}
    for handover in ("carried", "redrawn"):
        systematic, spread = _pair(results, SMOOTH, 300, handover)
        good[handover] = bool(lost(systematic).mean() >= LOSES and lost(spread).mean() <= KEEPS)
        parts.append(f"particles {handover}: systematic {_rms_text(systematic)}, spread {_rms_text(spread)}")
    what = (
        "The improved resampling keeps the target (at most 3 % of the runs lost) where systematic resampling loses it "
        "(at least 15 %): smooth motion, 300 particles"
    )
    paper = "particle degeneracy is avoided"
    return Claim(what, paper, "; ".join(parts), judge_claim(all(good.values()), good["carried"]))


def _lowers_the_error(results: Results) -> Claim:
    parts, good = [], {}
    for handover in ("carried", "redrawn"):
        for particles in PARTICLES:
            systematic, spread = _pair(results, SMOOTH, particles, handover)
            good[handover, particles] = exceeds(systematic.rms_m(), spread.rms_m())
            means = f"{systematic.rms_m().mean():.1f} -> {spread.rms_m().mean():.1f} m"
            parts.append(f"{particles} particles {handover} {means}")
    plainly, carried = all(good.values()), all(good["carried", n] for n in PARTICLES)
    what = "The improved resampling lowers the error where the motion is smooth"
    return Claim(what, "higher accuracy", "mean RMS of a run: " + ", ".join(parts), judge_claim(plainly, carried))


def _does_no_harm(results: Results) -> Claim:
    ratios = {
        (particles, handover): _rmse_ratio(results, ROUGH, particles, handover)
        for particles in PARTICLES
        for handover in ("carried", "redrawn")
    }
    low, high = HARMLESS
    good = all(low <= ratio <= high for ratio in ratios.values())
    under = low <= ratios[300, "carried"] <= high
    ours = ", ".join(f"{ratio:.3f} ({n} particles {handover})" for (n, handover), ratio in ratios.items())
    what = f"It does no harm where the motion is rough: RMSE of spread over systematic within {low}..{high}"
    return Claim(what, "-", ours, judge_claim(good, under))


def _handover_regularises(results: Results) -> Claim:
    carried, redrawn = (results.resampling(SMOOTH, 300, h, "systematic") for h in ("carried", "redrawn"))
    good = exceeds(carried.rms_m(), redrawn.rms_m())
    ours = f"carried {_rms_text(carried)}; redrawn {_rms_text(redrawn)}"
    what = (
        "Handing over mean and covariance is itself a regulariser: systematic resampling, smooth motion, 300 particles"
    )
    return Claim(what, "a handover of little data", ours, judge_claim(good, good))


def _silence(results: Results) -> Claim:
    parts, good = [], []
    for threshold_db in (80.0, 85.0, 88.0, 92.0):
        deaf, aware = (results.threshold(threshold_db, silent) for silent in (False, True))
        good.append(exceeds(deaf.rms_m(), aware.rms_m()))
        spent = aware.energy_mj.mean() / deaf.energy_mj.mean()
        errors = f"{deaf.pooled_rms_m()[0]:.2f} -> {aware.pooled_rms_m()[0]:.2f} m"
        parts.append(f"{threshold_db:g} dB {errors} for {spent:.2f} of the energy")
    what = "That a member kept silent is information: the error falls at no energy"
    return Claim(what, "-", "; ".join(parts), judge_claim(all(good), good[1]))


def _thresholds_save(results: Results) -> Claim:
    low, high = (results.threshold(db, True) for db in (80.0, KNEE_DB))
    saved = 1 - high.energy_mj.mean() / low.energy_mj.mean()
    worse = high.pooled_rms_m()[0] / low.pooled_rms_m()[0] - 1
    good = bool(saved > 0.2 and worse < 0.2)
    ours = f"from 80 to {KNEE_DB:g} dB {100 * saved:.0f} % less energy for an error {100 * worse:.0f} % larger"
    what = "A threshold on reports saves energy at little loss"
    return Claim(what, "members report above a threshold only", ours, judge_claim(good, good))


def knee_db(results: Results) -> float:
    """Threshold of the point farthest below the chord of the trade-off between energy and error, both scaled to 1."""
    records = [results.threshold(db, True) for db in THRESHOLDS_DB]
    spent = np.array([record.energy_mj.mean() for record in records])
    error = np.array([record.pooled_rms_m()[0] for record in records])
    x, y = (spent - spent[-1]) / (spent[0] - spent[-1]), (error - error[0]) / (error[-1] - error[0])
    return THRESHOLDS_DB[int((x + y).argmin())]


def _knee(results: Results) -> Claim:
    knee = knee_db(results)
    good = abs(knee - KNEE_DB) <= 2.0
    ours = f"farthest below the chord of energy against error: {knee:g} dB"
    return Claim(f"{KNEE_DB:g} dB is the knee of the trade-off, within 2 dB", "-", ours, judge_claim(good, good))


def _hysteresis(results: Results) -> Claim:
    records = {db: results.hysteresis(db) for db in HYSTERESES_DB}
    base, calm = records[0.0], records[3.0]
    difference = calm.rms_m() - base.rms_m()
    same = difference.mean() <= max(2 * standard_error(difference), 0.02 * base.rms_m().mean())
    good = bool(calm.handover.mean() <= 0.6 * base.handover.mean() and same)
    ours = "; ".join(
        f"{db:g} dB: {r.handover.mean():.3f} handovers a period, {r.pooled_rms_m()[0]:.2f} m"
        for db, r in records.items()
    )
    what = "A head that stays until another is 3 dB stronger halves the handovers at the same error"
    return Claim(what, "-", ours, judge_claim(good, good))
