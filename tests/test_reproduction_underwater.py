"""The reproduction of the underwater system: its figures, its files, its verdicts."""

import csv
import re
from pathlib import Path

import numpy as np
import pytest

from tests.figures import check_tables
from wsn_env.papers import reproduce
from wsn_env.papers.claim import HOLDS, NOT_REPRODUCED, UNDER_READING
from wsn_env.papers.rollout import exceeds, play
from wsn_env.papers.underwater.coverage import COVERAGE
from wsn_env.papers.underwater.expected import HARMLESS, MEDIAN_M, RMSE_M, SHARE_LOST, THRESHOLD
from wsn_env.papers.underwater.systems import (
    LEAVING_PERIODS,
    MIDDLE,
    NOISES,
    RESAMPLINGS,
    ROUGH,
    SMOOTH,
    STARTS,
    first_heads,
    hysteresis_trial,
    leaving_trial,
    lost,
    periods_inside,
    resampling_trial,
    scenario_as_read,
    start_trial,
    threshold_trial,
)
from wsn_env.papers.underwater.tables import SHOWN

pytestmark = pytest.mark.xdist_group("reproduction_underwater")  # one process makes its files once

TABLES = (*SHOWN, "error", "claims", "additions", "expected")
PICTURES = ("error", "thresholds", "energy")


def read(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def silent(done, total, what):
    """No bar."""


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """Every file of the shortest run."""
    out = tmp_path_factory.mktemp("underwater") / "new"
    reproduce("underwater", out, runs=2, progress=silent)
    return out


def records(noise, particles, handover, runs=100):
    """With systematic resampling, the patent's and ours."""
    return [play(resampling_trial(noise, particles, handover, name, runs)) for name in RESAMPLINGS]


def test_the_improved_resampling_keeps_the_target_that_systematic_resampling_loses():
    systematic, patents, ours = records(SMOOTH, 300, "carried")
    assert lost(systematic).mean() >= 0.15
    assert lost(ours).mean() <= 0.03 < lost(patents).mean() < 0.15
    assert abs(ours.pooled_rms_m()[0] - 16.0) < 4 * ours.pooled_rms_m()[1]
    assert exceeds(systematic.rms_m(), patents.rms_m()) and exceeds(patents.rms_m(), ours.rms_m())
    for record in (patents, ours):  # the head follows the signal, not the belief
        np.testing.assert_array_equal(record.energy_mj, systematic.energy_mj)


def test_it_does_no_harm_to_a_rough_motion():
    systematic, *others = (record.pooled_rms_m()[0] for record in records(ROUGH, 300, "carried"))
    assert all(HARMLESS[0] <= other / systematic <= HARMLESS[1] for other in others)


def test_the_first_head_makes_no_difference_after_ten_periods():
    known, searched = (play(start_trial(MIDDLE, start, 100)).square_error() for start in STARTS)
    assert exceeds(searched[:, :10].mean(axis=1), known[:, :10].mean(axis=1))
    assert not exceeds(searched[:, 10:].mean(axis=1), known[:, 10:].mean(axis=1))
    nearest, strongest = (first_heads(MIDDLE, start, 100) for start in STARTS)
    assert 0.4 < (nearest.node == strongest.node).mean() < 0.8
    assert exceeds(strongest.distance_m, nearest.distance_m)


def test_tracks_end_where_the_target_leaves():
    record = play(leaving_trial(MIDDLE, "spread", 10))
    last = periods_inside(record, 1000.0)
    for track, k in zip(record.target_m, last, strict=True):
        inside = ((track >= 0) & (track <= 1000)).all(axis=1)
        assert inside[: k - 1].all() and not inside[k - 1]
    assert 10 < last.min() and last.max() < LEAVING_PERIODS


def test_a_handover_of_moments_regularises():
    carried, redrawn = (
        play(resampling_trial(SMOOTH, 100, handover, "systematic", 50)) for handover in ("carried", "redrawn")
    )
    assert exceeds(carried.rms_m(), redrawn.rms_m())


def test_silence_lowers_the_error_at_no_energy():
    deaf, aware = (play(threshold_trial(85.0, told, 50)) for told in (False, True))
    assert exceeds(deaf.rms_m(), aware.rms_m())
    assert aware.energy_mj.mean() == pytest.approx(deaf.energy_mj.mean(), rel=1e-3)
    np.testing.assert_array_equal(deaf.delivered, aware.delivered)  # the head follows the signal, not the belief


def test_hysteresis_halves_the_handovers():
    hasty, calm = (play(hysteresis_trial(db, 50)) for db in (0.0, 3.0))
    assert calm.handover.mean() < 0.6 * hasty.handover.mean()
    assert abs(calm.pooled_rms_m()[0] / hasty.pooled_rms_m()[0] - 1) < 0.1


@pytest.mark.parametrize("noise", NOISES)
def test_the_filter_knows_the_tracks_noise(noise):
    scenario = scenario_as_read(noise)
    assert scenario.filter_q == scenario.motion.acceleration_ms2
    assert scenario.filter_q**2 * scenario.period_s == pytest.approx(noise)
    assert scenario.periods == NOISES[noise] and noise in (SMOOTH, MIDDLE, ROUGH)


@pytest.mark.parametrize("name", TABLES)
def test_every_table_is_written(short, name):
    text = (short / f"{name}.csv").read_text()
    assert "nan" not in text and "inf" not in text.replace("information", "")
    assert "" not in next(csv.reader(text.splitlines())) and len(read(short / f"{name}.csv")) > 2


def test_the_page_shows_what_is_written(short):
    check_tables("reproduction/underwater.md", "reproduce/underwater", short, share=2 / 100)


def test_nothing_else_is_left_behind_and_pictures_are_pngs(short):
    expected = {f"{name}.csv" for name in TABLES} | {f"{name}.png" for name in PICTURES}
    assert {path.name for path in short.iterdir() if path.suffix != ".md"} == expected
    assert all((short / f"{name}.png").read_bytes().startswith(b"\x89PNG") for name in PICTURES)


def test_every_cell_is_there(short):
    lengths = dict(resampling=8, handover=3, thresholds=8, energy=8, hysteresis=4, first_head=6, leaving=9)
    assert {name: len(read(short / f"{name}.csv")) for name in lengths} == lengths
    assert len(read(short / "error.csv")) == NOISES[SMOOTH]
    thresholds, purposes = read(short / "thresholds.csv"), read(short / "energy.csv")
    costs = [float(row["energy J a period"]) for row in thresholds]
    assert all(after < before for before, after in zip(costs, costs[1:]))
    for cost, row in zip(costs, purposes, strict=True):
        parts = [float(row[name]) for name in row if name.endswith(" J") and not name.startswith("stderr")]
        assert len(parts) == 5 and cost == pytest.approx(sum(parts), rel=1e-4)


def test_the_coverage_names_what_is_there(short):
    root = Path(__file__).parents[1]
    for item in COVERAGE:
        files = re.findall(r"`([\w/]+\.py)`", item.where)
        tables = re.findall(r"tables? ([a-z_]+)(?: and ([a-z_]+))?", item.where)
        assert files or tables, item
        assert all((root / file).is_file() for file in files), item
        assert all((short / f"{name}.md").is_file() for pair in tables for name in pair if name), item


def test_every_expected_figure_and_claim_is_listed(short):
    rows = read(short / "expected.csv")
    assert len(rows) == 7 + 2 * len(SHARE_LOST) + 2 * len(RMSE_M) + 2 * len(MEDIAN_M) + 1 + len(THRESHOLD) + 1 + 4
    claims = read(short / "claims.csv")
    additions = read(short / "additions.csv")
    assert (len(claims), len(additions)) == (4, 8)
    assert {row["verdict"] for row in claims + additions} <= {HOLDS, UNDER_READING, NOT_REPRODUCED}


@pytest.mark.slow
@pytest.mark.full
def test_the_whole_reproduction(tmp_path):
    reproduce("underwater", tmp_path, runs=100, progress=silent)
    assert [row["quantity"] for row in read(tmp_path / "expected.csv") if row["within"] != "True"] == []
    verdicts = [row["verdict"] for name in ("claims", "additions") for row in read(tmp_path / f"{name}.csv")]
    assert NOT_REPRODUCED not in verdicts
    for row in read(tmp_path / "resampling.csv"):
        if (row["motion"], row["particles"]) == ("smooth", "300"):
            assert float(row["lost %, ours"]) <= 3 and float(row["lost %, ours"]) <= float(row["lost %, patent's"])
