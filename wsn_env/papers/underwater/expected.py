"""Figures expected of the underwater system: an independent implementation's, beside ours.

An error expected comes from 100 runs, whose own noise is about ours: it is met within three standard errors of the
difference.
"""

from __future__ import annotations

from math import sqrt

from wsn_env.models.acoustics import absorption_db_per_km
from wsn_env.models.state import PURPOSES
from wsn_env.papers.claim import Expectation
from wsn_env.papers.rollout import Record
from wsn_env.papers.underwater.systems import ROUGH, SMOOTH, Results, lost, median_rms_m
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
        for record, share, what in zip(pair(results, *cell), shares, _names(*cell), strict=True):
            tolerance = max(KEEPS, MET * sqrt(share * (1 - share) / results.runs))
            figures.append(Expectation(f"share lost: {what}", share, tolerance, float(lost(record).mean())))
    for statistic, table, measure in (("RMSE", RMSE_M, Record.pooled_rms_m), ("median RMS", MEDIAN_M, median_rms_m)):
        for cell, metres in table.items():
            for record, value, what in zip(pair(results, *cell), metres, _names(*cell), strict=True):
                figures.append(_error(f"{statistic} [m]: {what}", value, *measure(record)))
    low, high = HARMLESS
    middle, half = (low + high) / 2, (high - low) / 2
    ratio = rmse_ratio(results, ROUGH, 300, "carried")
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
    return [f"noise {noise:g} m^2/s^3, {particles} particles {handover}, {name}" for name in ("systematic", "spread")]


def energy_j(record: Record) -> dict[str, float]:
    """Mean energy of a period by purpose [J]."""
    return dict(zip(PURPOSES, (record.purposes_mj.mean(axis=(0, 1)) / 1e3).tolist(), strict=True))


def pair(results: Results, noise: float, particles: int, handover: str) -> list[Record]:
    """Records with systematic resampling and with ours."""
    return [results.resampling(noise, particles, handover, name) for name in ("systematic", "spread")]


def rmse_ratio(results: Results, noise: float, particles: int, handover: str) -> float:
    """RMSE with our resampling over that with systematic resampling."""
    systematic, spread = pair(results, noise, particles, handover)
    return spread.pooled_rms_m()[0] / systematic.pooled_rms_m()[0]
