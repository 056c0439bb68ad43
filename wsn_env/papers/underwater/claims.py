"""What the patent claims, and what we add to it: how both are judged from the figures measured.

The patent gives no figures. Its resampling is judged as it is written, with one spread for all parents; our variant of
it, with a spread for each, is an addition. A difference counts when it exceeds two standard errors, paired where both
have played the same runs.
"""

from __future__ import annotations

import numpy as np

from wsn_env.evaluation.intervals import standard_error
from wsn_env.papers.claim import Claim, judge_claim
from wsn_env.papers.lifetimes import judge_lifetimes
from wsn_env.papers.rollout import Record, exceeds
from wsn_env.papers.underwater.expected import HARMLESS, KEEPS, LOSES, rmse_ratio
from wsn_env.papers.underwater.systems import (
    HANDOVERS,
    HYSTERESES_DB,
    LIFETIMES_DB,
    PARTICLES,
    RESAMPLING_NOISES,
    ROUGH,
    SMOOTH,
    THRESHOLDS_DB,
    Results,
    lifetime_trial,
    lost,
)

KNEE_DB = 88.0
LITTLE = 0.2  # share of the error that is little loss
CELLS = [(particles, handover) for handover in HANDOVERS for particles in PARTICLES]
PATENTS_CELL = 300, "redrawn"  # mean and covariance are handed over


def judge_claims(results: Results) -> list[Claim]:
    """The patent's."""
    return [
        _avoids_degeneracy(results),
        _improves_tracking(results),
        _moments_suffice(results),
        _thresholds_save(results),
    ]


def judge_additions(results: Results) -> list[Claim]:
    """Ours."""
    return [
        _ours_keeps_the_target(results),
        _ours_beats_the_patents(results),
        _ours_does_no_harm(results),
        _handover_regularises(results),
        _silence(results),
        _knee(results),
        _hysteresis(results),
        _lifetime(results),
    ]


def _rms_text(record: Record) -> str:
    return f"{record.pooled_rms_m()[0]:.1f} m, {100 * lost(record).mean():.0f} % lost"


def _change(before: np.ndarray, after: np.ndarray) -> str:
    """Both means, and the standard error of the paired difference."""
    difference = after - before
    return f"{before.mean():.1f} to {after.mean():.1f} m ({difference.mean():+.1f}, {standard_error(difference):.1f})"


def _avoids_degeneracy(results: Results) -> Claim:
    parts, keeps, fewer = [], {}, {}
    for cell in CELLS:
        before, after = (
            lost(results.resampling(SMOOTH, *cell, name)).astype(float) for name in ("systematic", "common_spread")
        )
        keeps[cell], fewer[cell] = after.mean() <= KEEPS, exceeds(before, after)
        shares = f"{100 * before.mean():.0f} to {100 * after.mean():.0f} %"
        parts.append(f"{shares} ({cell[0]} particles {cell[1]})")
    what = (
        "The improved resampling, one spread for all, avoids degeneracy: fewer runs are lost than with systematic"
        f" resampling, at most {100 * KEEPS:.0f} % (smooth motion)"
    )
    plainly = all(keeps.values()) and all(fewer.values())
    verdict = judge_claim(plainly, bool(keeps[PATENTS_CELL] and fewer[PATENTS_CELL]))
    return Claim(what, "particle degeneracy is avoided", "lost: " + ", ".join(parts), verdict)


def _improves_tracking(results: Results) -> Claim:
    parts, good = [], {}
    for noise, motion in zip(RESAMPLING_NOISES, ("smooth", "rough"), strict=True):
        for cell in CELLS:
            before, after = (results.resampling(noise, *cell, name).rms_m() for name in ("systematic", "common_spread"))
            good[noise, cell] = exceeds(before, after)
            parts.append(f"{motion}, {cell[0]} particles {cell[1]} {_change(before, after)}")
    what = "The improved resampling, one spread for all, lowers the error"
    ours = "mean RMS of a run (difference, its standard error): " + "; ".join(parts)
    smooth = all(good[SMOOTH, cell] for cell in CELLS)
    return Claim(what, "tracking performance is improved", ours, judge_claim(all(good.values()), smooth))


def _moments_suffice(results: Results) -> Claim:
    parts, good = [], []
    for noise, motion in zip(RESAMPLING_NOISES, ("smooth", "rough"), strict=True):
        for particles in PARTICLES:
            carried, redrawn = (results.resampling(noise, particles, h, "common_spread") for h in HANDOVERS)
            good.append(not exceeds(redrawn.rms_m(), carried.rms_m()))
            parts.append(f"{motion}, {particles} particles {_change(carried.rms_m(), redrawn.rms_m())}")
    what = "Mean and covariance are all that the next head needs: no larger an error than with the particles themselves"
    ours = "mean RMS of a run, carried to redrawn (difference, its standard error): " + "; ".join(parts)
    paper = "estimate and variance are sent to the next head"
    return Claim(what, paper, ours, judge_claim(all(good), all(good)))


def _thresholds_save(results: Results) -> Claim:
    parts, good = [], []
    for silent in (False, True):
        low, high = (results.threshold(db, silent) for db in (80.0, KNEE_DB))
        saved = 1 - high.energy_mj.mean() / low.energy_mj.mean()
        worse = high.pooled_rms_m()[0] / low.pooled_rms_m()[0] - 1
        good.append(bool(exceeds(low.energy_mj.mean(axis=1), high.energy_mj.mean(axis=1)) and worse < LITTLE))
        told = "told" if silent else "ignored"
        parts.append(f"{100 * saved:.0f} % less energy for an error {100 * worse:.0f} % larger (silence {told})")
    what = f"A threshold on reports saves energy at little loss, below {100 * LITTLE:.0f} % of the error"
    ours = f"from 80 to {KNEE_DB:g} dB " + ", ".join(parts)
    return Claim(what, "members report above a threshold only", ours, judge_claim(all(good), good[1]))


def _ours_keeps_the_target(results: Results) -> Claim:
    parts, good = [], {}
    for handover in HANDOVERS:
        systematic, ours = (results.resampling(SMOOTH, 300, handover, name) for name in ("systematic", "spread"))
        good[handover] = bool(lost(systematic).mean() >= LOSES and lost(ours).mean() <= KEEPS)
        parts.append(f"particles {handover}: systematic {_rms_text(systematic)}, ours {_rms_text(ours)}")
    what = (
        f"A spread for each parent keeps the target (at most {100 * KEEPS:.0f} % of the runs lost) where systematic"
        f" resampling loses it (at least {100 * LOSES:.0f} %): smooth motion, 300 particles"
    )
    expected = "28 against 0 % carried, 4 against 0 % redrawn"
    return Claim(what, expected, "; ".join(parts), judge_claim(all(good.values()), good["carried"]))


def _ours_beats_the_patents(results: Results) -> Claim:
    parts, good = [], {}
    for cell in CELLS:
        before, after = (results.resampling(SMOOTH, *cell, name).rms_m() for name in ("common_spread", "spread"))
        good[cell] = exceeds(before, after)
        parts.append(f"{cell[0]} particles {cell[1]} {_change(before, after)}")
    what = "A spread for each parent has a smaller error than one for all, where the motion is smooth"
    ours = "mean RMS of a run (difference, its standard error): " + "; ".join(parts)
    carried = all(good[particles, "carried"] for particles in PARTICLES)
    return Claim(what, "-", ours, judge_claim(all(good.values()), carried))


def _ours_does_no_harm(results: Results) -> Claim:
    ratios = {cell: rmse_ratio(results, ROUGH, *cell) for cell in CELLS}
    low, high = HARMLESS
    good = {cell: low <= ratio <= high for cell, ratio in ratios.items()}
    ours = ", ".join(f"{ratio:.3f} ({n} particles {handover})" for (n, handover), ratio in ratios.items())
    what = "It does no harm where the motion is rough: RMSE over that of systematic resampling"
    return Claim(what, f"{low} to {high}", ours, judge_claim(all(good.values()), good[300, "carried"]))


def _handover_regularises(results: Results) -> Claim:
    carried, redrawn = (results.resampling(SMOOTH, 300, h, "systematic") for h in HANDOVERS)
    good = exceeds(carried.rms_m(), redrawn.rms_m())
    ours = f"carried {_rms_text(carried)}; redrawn {_rms_text(redrawn)}"
    what = (
        "Handing over mean and covariance is itself a regulariser: systematic resampling, smooth motion, 300 particles"
    )
    return Claim(what, "78.4 m, 28 % against 33.7 m, 4 %", ours, judge_claim(good, good))


def _silence(results: Results) -> Claim:
    parts, good = [], []
    for threshold_db in (80.0, 85.0, 88.0, 92.0):
        deaf, aware = (results.threshold(threshold_db, silent) for silent in (False, True))
        good.append(exceeds(deaf.rms_m(), aware.rms_m()))
        spent = aware.energy_mj.mean() / deaf.energy_mj.mean()
        errors = f"{deaf.pooled_rms_m()[0]:.2f} to {aware.pooled_rms_m()[0]:.2f} m"
        parts.append(f"{threshold_db:g} dB {errors} for {spent:.2f} of the energy")
    what = "That a member kept silent is information: the error falls at no energy"
    return Claim(what, "17.55 to 15.74 m at 85 dB", "; ".join(parts), judge_claim(all(good), good[1]))


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
    return Claim("The trade-off has its knee at 88 dB", f"{KNEE_DB:g} dB, within 2", ours, judge_claim(good, good))


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
    return Claim(what, "half, within 0.1", ours, judge_claim(good, good))


def _lifetime(results: Results) -> Claim:
    without, calm = (results.lifetime(db) for db in LIFETIMES_DB)
    what = "With 3 dB of hysteresis the network lasts longer than without"
    nodes = lifetime_trial(LIFETIMES_DB[0], results.runs).scenario.field.nodes
    return judge_lifetimes(what, "-", "30 J", nodes, calm, without)
