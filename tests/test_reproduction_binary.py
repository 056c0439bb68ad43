"""The reproduction of the binary sensors' paper: its figures, its files, its verdicts."""

import csv

import numpy as np
import pytest

from tests.figures import check_tables
from wsn_env.papers import reproduce
from wsn_env.papers.binary.claims import DEFAULTS, SHIFT_BIAS_M, Study
from wsn_env.papers.binary.readings import PAIRS, boundary_nodes, detecting_nodes, even_period_s, lens_m2
from wsn_env.papers.binary.systems import FAULTS, FLIP, SYSTEMS, Results, Setting
from wsn_env.papers.claim import HOLDS, NOT_REPRODUCED, UNDER_READING
from wsn_env.papers.rollout import play, standard_error

PICTURES = ("error", "nodes", "radius", "period")
TABLES = ("systems", "readings", "faults", *PICTURES, "claims", "expected")
RUNS = 20


def silent(done, total, what):
    """No bar."""


def read(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def results_of(*settings, runs=RUNS):
    return Results(runs, {setting: play(setting.trial(runs)) for setting in settings})


@pytest.fixture(scope="module")
def defaults():
    """Every system at the defaults, twenty runs."""
    return results_of(*(Setting(name) for name in SYSTEMS))


@pytest.fixture(scope="module")
def study(defaults):
    return Study(defaults)


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """Every file of the shortest run."""
    out = tmp_path_factory.mktemp("binary") / "new"
    reproduce("binary", out, runs=2, progress=silent)
    return out


# --- closed forms -------------------------------------------------------------------------------------------


def test_closed_forms():
    assert boundary_nodes() == pytest.approx(8.127, abs=5e-4)
    assert detecting_nodes() == pytest.approx(27.143, abs=5e-4)
    assert boundary_nodes(period_s=even_period_s()) == pytest.approx(detecting_nodes())
    assert even_period_s() == pytest.approx(3.428, abs=5e-4)


def test_the_lens_is_the_area_that_two_discs_share():
    assert lens_m2(0.0, 60.0) == pytest.approx(np.pi * 3600) and lens_m2(120.0, 60.0) == 0 == lens_m2(500.0, 60.0)
    points = np.random.default_rng(0).uniform(-90, 90, (200_000, 2))
    shared = (np.hypot(*(points - [20, 0]).T) < 60) & (np.hypot(*(points + [20, 0]).T) < 60)
    error = 180**2 * shared.std() / len(points) ** 0.5
    assert abs(180**2 * shared.mean() - lens_m2(40.0, 60.0)) < 4 * error


# --- the systems in their short form ------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "quantity", "expected", "tolerance"), DEFAULTS)
def test_the_expected_errors(defaults, name, quantity, expected, tolerance):
    """Twenty runs instead of a hundred: the tolerance, four standard errors, grows with the root of that."""
    error = defaults.error_m(Setting(name))
    measured = {"mean": error.mean(), "median": np.median(error), "rms": np.sqrt((error**2).mean())}[quantity]
    assert abs(measured - expected) < tolerance * 5**0.5


def test_how_many_nodes_report(defaults):
    for name, expected in (("paper", boundary_nodes()), ("centroid", detecting_nodes())):
        nodes = defaults.reporting(Setting(name))
        assert abs(nodes.mean() - expected) < 4 * standard_error(nodes) < 0.1 * expected


def test_systems_meet_the_same_fields_and_the_same_target_at_the_same_time(defaults):
    edge, inside = Setting("paper"), Setting("ekf")
    tracks = [defaults.records[setting].target_m[:, setting.steady] for setting in (edge, inside)]
    np.testing.assert_allclose(tracks[0], tracks[1], atol=1e-9)
    assert edge.time_s[edge.steady][[0, -1]].tolist() == [15, 40]
    assert Setting("paper", period_s=4.0).time_s[-1] == 48


def test_long_periods_spoil_the_velocity_that_is_fed_back_and_not_the_fix():
    settings = [Setting(name, period_s=5.0) for name in ("raw", "paper", "centroid")]
    results = results_of(*settings)
    raw, paper, centroid = (results.rms_m(setting) for setting in settings)
    assert raw < centroid < paper


def test_all_pairs_are_best_and_another_sign_leaves_a_bias(study):
    rms = {name: study.rms_m(name)[0] for name in PAIRS}
    assert rms["all pairs"] < min(rms["consecutive pairs"], rms["one reference node"])
    for name, expected in SHIFT_BIAS_M.items():
        bias, error = study.bias_m(name)
        assert abs(bias - expected) < 4 * error < 2


def test_the_recursion_as_printed_stays_behind(study):
    assert study.printed_rms_m() == pytest.approx(192, abs=4)


def test_misread_bits_ruin_least_squares_and_not_the_particle_filter():
    settings = [Setting(name, flip=FLIP) for name in ("mid", "particle")]
    results = results_of(*settings, runs=10)
    assert results.rms_m(settings[0]) > 30 and results.rms_m(settings[1]) < 3


# --- the files ----------------------------------------------------------------------------------------------


def test_the_page_shows_what_is_written(short):
    check_tables("reproduction/binary.md", "reproduce/binary", short, share=2 / 100)


def test_every_file_is_written(short):
    expected = {f"{name}.csv" for name in TABLES} | {f"{name}.png" for name in PICTURES}
    assert {path.name for path in short.iterdir() if path.suffix != ".md"} == expected
    for name in PICTURES:
        assert (short / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    for name in TABLES:
        text = (short / f"{name}.csv").read_text()
        assert "nan" not in text and "inf" not in text


def test_every_row_is_there(short):
    assert [row["system"] for row in read(short / "systems.csv")] == list(SYSTEMS)
    assert len(read(short / "faults.csv")) == len(FAULTS)
    assert len(read(short / "expected.csv")) == 73
    assert len(read(short / "error.csv")) == 50
    claims = read(short / "claims.csv")
    assert len(claims) == 8 and {row["verdict"] for row in claims} <= {HOLDS, UNDER_READING, NOT_REPRODUCED}


@pytest.mark.slow
@pytest.mark.full
def test_the_whole_reproduction(tmp_path):
    reproduce("binary", tmp_path, runs=100, progress=silent)
    assert [row["quantity"] for row in read(tmp_path / "expected.csv") if row["within"] != "True"] == []
    verdicts = {row["claim"]: row["verdict"] for row in read(tmp_path / "claims.csv")}
    refuted = {claim for claim, verdict in verdicts.items() if verdict == NOT_REPRODUCED}
    assert refuted == {
        "the centroid degrades as the range R grows",
        "the crossing comes from the fixes, which long periods blur",
        "the recursion of eqs. 12-13 as printed follows the target",
    }
