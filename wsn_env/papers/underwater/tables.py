"""The tables of the underwater system; figures with their standard errors over the runs."""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from wsn_env.evaluation.intervals import standard_error
from wsn_env.models.acoustics import absorption_db_per_km, ambient_noise_db
from wsn_env.models.state import PURPOSES
from wsn_env.papers.rollout import Record, pooled_rms
from wsn_env.papers.sheet import Sheet, by_period
from wsn_env.papers.underwater.systems import (
    HANDOVERS,
    HYSTERESES_DB,
    LOST_M,
    MOTIONS,
    NOISES,
    PARTICLES,
    RESAMPLING_NOISES,
    RESAMPLINGS,
    SMOOTH,
    STARTS,
    THRESHOLDS_DB,
    Results,
    lost,
    periods_inside,
    resampling_trial,
    threshold_trial,
)
from wsn_env.scenario import Scenario

FREQUENCIES_KHZ = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
SETTLED = 10  # periods after which the start is forgotten
SHOWN = {"acoustics": "Sound in the sea", "resampling": "Resampling", "handover": "What a handover costs"} | {
    "thresholds": "Thresholds",
    "energy": "Energy by purpose",
    "hysteresis": "Hysteresis of the head",
    "first_head": "First head",
    "leaving": "Until the target leaves",
}


def make_tables(results: Results) -> dict[str, Sheet]:
    """All by name: those of SHOWN, and the error in each period."""
    return {
        "acoustics": acoustics(),
        "resampling": resampling(results),
        "handover": handover(results),
        "thresholds": thresholds(results),
        "energy": energy(results),
        "hysteresis": hysteresis(results),
        "first_head": first_head(results),
        "leaving": leaving(results),
        "error": error_per_period(results),
    }


def acoustics() -> Sheet:
    """Absorption (Thorp) and ambient noise (Wenz) against frequency."""
    rows = [(f, absorption_db_per_km(f), ambient_noise_db(f)) for f in FREQUENCIES_KHZ]
    return Sheet(("frequency kHz", "absorption dB/km", "ambient noise dB"), rows)


def resampling(results: Results) -> Sheet:
    """Error and share of lost runs with each resampling."""
    rows = []
    for noise in RESAMPLING_NOISES:
        for particles in PARTICLES:
            for name in HANDOVERS:
                records = [results.resampling(noise, particles, name, resampling) for resampling in RESAMPLINGS]
                errors = [each for record in records for each in record.pooled_rms_m()]
                shares = [each for record in records for each in _percent(lost(record))]
                rows.append((MOTIONS[noise], particles, name, *errors, *shares))
    named = [f"RMSE m, {name}" for name in RESAMPLINGS.values()] + [f"lost %, {name}" for name in RESAMPLINGS.values()]
    return Sheet(("motion", "particles", "at a handover", *_with_errors(*named)), rows)


def handover(results: Results) -> Sheet:
    """What is handed over, and what that takes: smooth motion. No energy depends on the resampling."""
    rows = []
    for name, particles in [("redrawn", 300), *(("carried", n) for n in PARTICLES)]:
        record = results.resampling(SMOOTH, particles, name, "common_spread")
        scenario = resampling_trial(SMOOTH, particles, name, "common_spread", results.runs).scenario
        radio: Any = scenario.radio
        handed = "mean and covariance" if name == "redrawn" else f"{particles} particles"
        seconds = scenario.handover_bits / radio.bit_rate
        rows.append((handed, scenario.handover_bits, seconds, *_purpose_j(record, "handover"), *_energy_j(record)))
    named = _with_errors("handovers J a period", "energy J a period")
    return Sheet(("handed over", "bits", "seconds to send", *named), rows)


def thresholds(results: Results) -> Sheet:
    """Reports, energy and error against the threshold, without and with what silence tells."""
    rows = []
    for threshold_db in THRESHOLDS_DB:
        radius_m = threshold_trial(threshold_db, True, results.runs).scenario.radius_m
        deaf, aware = (results.threshold(threshold_db, silent) for silent in (False, True))
        errors = *deaf.pooled_rms_m(), *aware.pooled_rms_m()
        rows.append((threshold_db, radius_m, *_mean(aware.delivered), *_energy_j(aware), *errors))
    named = _with_errors("reports a period", "energy J a period", "RMSE m, silence ignored", "RMSE m, silence told")
    return Sheet(("threshold dB", "range m", *named), rows)


def energy(results: Results) -> Sheet:
    """Energy of a period by purpose against the threshold [J]."""
    spent = [purpose for purpose in PURPOSES if purpose != "search"]  # nobody searches
    rows = []
    for threshold_db in THRESHOLDS_DB:
        record = results.threshold(threshold_db, True)
        rows.append((threshold_db, *(each for purpose in spent for each in _purpose_j(record, purpose))))
    return Sheet(("threshold dB", *_with_errors(*(f"{PURPOSE_WORDS[purpose]} J" for purpose in spent))), rows)


PURPOSE_WORDS = dict(zip(PURPOSES, PURPOSES)) | {"sensing": "listening, sleeping", "broadcast": "word to resample"}


def hysteresis(results: Results) -> Sheet:
    """Handovers, energy and error against the head's hysteresis."""
    rows = []
    for hysteresis_db in HYSTERESES_DB:
        record = results.hysteresis(hysteresis_db)
        rows.append((hysteresis_db, *_mean(record.handover), *_energy_j(record), *record.pooled_rms_m()))
    return Sheet(("hysteresis dB", *_with_errors("handovers a period", "energy J a period", "RMSE m")), rows)


def first_head(results: Results) -> Sheet:
    """Error with either first head, at first and after."""
    rows = []
    for noise in NOISES:
        strongest = results.first_heads[noise, list(STARTS)[-1]].node
        for start in STARTS:
            heads, square = results.first_heads[noise, start], results.start(noise, start).square_error()
            errors = *pooled_rms(square[:, :SETTLED]), *pooled_rms(square[:, SETTLED:])
            rows.append((MOTIONS[noise], start, *_percent(heads.node == strongest), *_mean(heads.distance_m), *errors))
    first, after = f"RMSE m, periods 1 to {SETTLED}", "RMSE m, after"
    named = _with_errors("the strongest signal's %", "to the target m", first, after)
    return Sheet(("motion", "first head", *named), rows)


def leaving(results: Results) -> Sheet:
    """Error and share of lost runs of tracks that end outside the field."""
    rows = []
    side_m = Scenario.named("Underwater-v0").field.side_m
    for noise in NOISES:
        for name, words in RESAMPLINGS.items():
            record = results.leaving(noise, name)
            last = periods_inside(record, side_m)
            inside = np.arange(record.energy_mj.shape[1]) < last[:, None]
            square = record.square_error()
            runs = np.sqrt(np.where(inside, square, 0).sum(axis=1) / last)
            gone = np.sqrt(square[np.arange(len(last)), last - 1]) > LOST_M
            rows.append((MOTIONS[noise], words, *_mean(last), *_mean(runs), *_percent(gone)))
    named = _with_errors(
        "periods until it leaves", "mean RMS of a run m", f"farther off than {LOST_M:g} m at the end %"
    )
    return Sheet(("motion", "resampling", *named), rows)


def error_per_period(results: Results) -> Sheet:
    """Mean error over the runs in each period [m]: smooth motion, 300 particles."""
    cells = [(name, handover) for name in RESAMPLINGS for handover in HANDOVERS]
    errors = [
        np.sqrt(results.resampling(SMOOTH, 300, handover, name).square_error()).mean(axis=0) for name, handover in cells
    ]
    return by_period([f"{RESAMPLINGS[name]}, {handover}" for name, handover in cells], errors)


def _with_errors(*names: str) -> tuple[str, ...]:
    """Each column, and that of its standard error."""
    return tuple(each for name in names for each in (name, f"stderr {name}"))


def _mean(values: np.ndarray) -> tuple[float, float]:
    """Over runs (R,) or runs and periods (R, K), and its standard error over the runs."""
    runs = values.reshape(len(values), -1).mean(axis=1)
    return float(runs.mean()), standard_error(runs)


def _percent(values: np.ndarray) -> tuple[float, float]:
    """Share of runs (R,) bool, and its standard error."""
    share = float(values.mean())
    return 100 * share, 100 * sqrt(share * (1 - share) / len(values))


def _energy_j(record: Record) -> tuple[float, float]:
    return _mean(record.energy_mj / 1e3)


def _purpose_j(record: Record, purpose: str) -> tuple[float, float]:
    return _mean(record.purposes_mj[:, :, PURPOSES.index(purpose)] / 1e3)
