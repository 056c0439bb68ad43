"""The reproduction of the underwater system: its figures, its files, its verdicts."""

import csv

import numpy as np
import pytest

from tests.figures import check_tables
from wsn_env.papers import reproduce
from wsn_env.papers.claim import HOLDS, NOT_REPRODUCED, UNDER_READING
from wsn_env.papers.rollout import exceeds, play
from wsn_env.papers.underwater.claims import HARMLESS, MEDIAN_M, RMSE_M, SHARE_LOST, THRESHOLD
from wsn_env.papers.underwater.systems import (
    MIDDLE,
    NOISES,
    ROUGH,
    SMOOTH,
    hysteresis_trial,
    lost,
    resampling_trial,
    scenario_as_read,
    threshold_trial,
)

COSTS = "reports,energy_j,sensing_j,handover_j,invitation_j,report_j,broadcast_j,search_j"
COLUMNS = {
    "acoustics": "frequency_khz,absorption_db_per_km,noise_db",
    "resampling": "noise_m2s3,particles,handover,resampling,rmse_m,stderr_m,lost,runs",
    "error": "period,systematic_carried_m,systematic_redrawn_m,spread_carried_m,spread_redrawn_m",
    "thresholds": f"threshold_db,radius_m,silence_told,rmse_m,stderr_m,{COSTS}",
    "hysteresis": f"hysteresis_db,rmse_m,stderr_m,handovers,{COSTS}",
    "claims": "claim,paper,ours,verdict",
    "expected": "quantity,expected,tolerance,measured,within",
}
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


def pair(noise, particles, handover, runs=100):
    """Records with systematic resampling, and with the improved one."""
    return [play(resampling_trial(noise, particles, handover, name, runs)) for name in ("systematic", "spread")]


def test_the_improved_resampling_keeps_the_target_that_systematic_resampling_loses():
    systematic, spread = pair(SMOOTH, 300, "carried")
    assert lost(systematic).mean() >= 0.15
    assert lost(spread).mean() <= 0.03
    assert abs(spread.pooled_rms_m()[0] - 16.0) < 4 * spread.pooled_rms_m()[1]
    assert exceeds(systematic.rms_m(), spread.rms_m())


def test_it_does_no_harm_to_a_rough_motion():
    systematic, spread = (record.pooled_rms_m()[0] for record in pair(ROUGH, 300, "carried"))
    assert HARMLESS[0] <= spread / systematic <= HARMLESS[1]


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


@pytest.mark.parametrize("name", COLUMNS)
def test_every_table_is_written(short, name):
    text = (short / f"{name}.csv").read_text()
    assert text.splitlines()[0] == COLUMNS[name]
    assert "nan" not in text and "inf" not in text.replace("information", "")


def test_the_page_shows_what_is_written(short):
    check_tables("reproduction/underwater.md", "reproduce/underwater", short, share=2 / 100)


def test_nothing_else_is_left_behind_and_pictures_are_pngs(short):
    expected = {f"{name}.csv" for name in COLUMNS} | {f"{name}.png" for name in PICTURES}
    assert {path.name for path in short.iterdir() if path.suffix != ".md"} == expected
    assert all((short / f"{name}.png").read_bytes().startswith(b"\x89PNG") for name in PICTURES)


def test_every_cell_is_there(short):
    assert len(read(short / "resampling.csv")) == 16
    assert len(read(short / "thresholds.csv")) == 16
    assert len(read(short / "error.csv")) == NOISES[SMOOTH]
    costs = [float(row["energy_j"]) for row in read(short / "thresholds.csv") if row["silence_told"] == "True"]
    assert all(after < before for before, after in zip(costs, costs[1:]))
    for row in read(short / "thresholds.csv"):
        assert float(row["energy_j"]) == pytest.approx(sum(float(row[name]) for name in COSTS.split(",")[2:]), rel=1e-4)


def test_every_expected_figure_and_claim_is_listed(short):
    rows = read(short / "expected.csv")
    assert len(rows) == 7 + 2 * len(SHARE_LOST) + 2 * len(RMSE_M) + 2 * len(MEDIAN_M) + 1 + len(THRESHOLD) + 1 + 4
    claims = read(short / "claims.csv")
    assert len(claims) == 8 and {row["verdict"] for row in claims} <= {HOLDS, UNDER_READING, NOT_REPRODUCED}


@pytest.mark.slow
@pytest.mark.full
def test_the_whole_reproduction(tmp_path):
    reproduce("underwater", tmp_path, runs=100, progress=silent)
    assert [row["quantity"] for row in read(tmp_path / "expected.csv") if row["within"] != "True"] == []
    assert NOT_REPRODUCED not in {row["verdict"] for row in read(tmp_path / "claims.csv")}
    cells = ("noise_m2s3", "particles", "handover", "resampling")
    share = {tuple(row[name] for name in cells): float(row["lost"]) for row in read(tmp_path / "resampling.csv")}
    assert share["1e-05", "300", "carried", "systematic"] >= 0.15
    for handover in ("carried", "redrawn"):
        assert share["1e-05", "300", handover, "spread"] <= 0.03
