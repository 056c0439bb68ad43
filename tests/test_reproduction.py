"""The reproduction of Pre-DC's paper: its figures, its files, its verdicts."""

import csv
from itertools import pairwise

import numpy as np
import pytest

from tests.figures import check_tables
from wsn_env.papers import reproduce
from wsn_env.papers.claim import HOLDS, NOT_REPRODUCED, UNDER_READING, Expectation, judge_claim, print_expected
from wsn_env.papers.pre_dc.claims import EXPECTED_RMS_M, PAPER_RMS_M, exceeds
from wsn_env.papers.pre_dc.systems import NODES, SYSTEMS, motion_trial, scenario_as_read
from wsn_env.papers.rollout import Trial, play, play_all, standard_error
from wsn_env.papers.sheet import show_table

FIGURES = ("fig1", "fig3", "fig4", "fig5", "fig6", "fig7", "fig8")
COLUMNS = {
    "table2": "nodes,system,paper_rms_m,rms_m,stderr_m,runs",
    "same_tracker": "policy,rms_m,stderr_m,energy_mj",
    "claims": "claim,paper,ours,verdict",
    "expected": "quantity,expected,tolerance,measured,within",
    "fig1": "distance_m,probability",
    "fig3": "period,static_rms_m,ekf_rms_m,pre_dc_rms_m",
    "fig4": "period,static_reports_mj,static_total_mj,ekf_mj,pre_dc_mj",
    "fig5": "track,period,target_x_m,target_y_m,estimate_x_m,estimate_y_m",
    "fig6": "period,straight_rms_m,sine_rms_m,circle_rms_m,turns_rms_m",
    "fig7": "particles,rms_x_m,stderr_m,runs",
    "fig8": "particles,rms_y_m,stderr_m,runs",
}


def silent(done, total, what):
    """No bar."""


def read(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """Every file of the shortest run, and what was told of its progress."""
    out = tmp_path_factory.mktemp("pre_dc") / "new" / "folder"
    told = []
    reproduce("pre_dc", out, runs=2, progress=lambda *news: told.append(news))
    return out, told


@pytest.mark.parametrize("nodes", [81, 225])
@pytest.mark.parametrize("name", SYSTEMS)
def test_table_2_in_its_short_form(name, nodes):
    system = SYSTEMS[name]
    rms = play(system.trial(nodes, 20)).rms_m(system.heard_only)
    expected = EXPECTED_RMS_M[name, nodes]
    assert abs(rms.mean() - expected) < 0.08 * expected + 3 * standard_error(rms)


def test_static_is_worst_in_its_short_form():
    static, *others = (play(SYSTEMS[name].trial(225, 20)).rms_m(SYSTEMS[name].heard_only) for name in SYSTEMS)
    assert all(exceeds(static, other) for other in others)


def test_a_small_q_diverges_on_a_curve():
    fitted, as_read = (play(motion_trial("sine", 5, fitting)).rms_m() for fitting in (True, False))
    assert fitted.max() < 3 < 10 < as_read.min()


@pytest.mark.parametrize("name", COLUMNS)
def test_every_table_is_written(short, name):
    text = (short[0] / f"{name}.csv").read_text()
    assert text.splitlines()[0] == COLUMNS[name]
    assert "nan" not in text and "inf" not in text.replace("information", "")


def test_the_page_shows_what_is_written(short):
    check_tables("reproduction/pre_dc.md", "reproduce/pre_dc", short[0], share=2 / 100)


def test_nothing_else_is_left_behind(short):
    expected = {f"{name}.csv" for name in COLUMNS} | {f"{name}.png" for name in FIGURES}
    assert {path.name for path in short[0].iterdir() if path.suffix != ".md"} == expected


@pytest.mark.parametrize("name", FIGURES)
def test_every_picture_is_a_png(short, name):
    assert (short[0] / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def test_table_2_has_every_cell(short):
    rows = read(short[0] / "table2.csv")
    assert [(int(r["nodes"]), r["system"]) for r in rows] == [(n, name) for n in NODES for name in SYSTEMS]
    for r in rows:
        assert r["paper_rms_m"] == str(PAPER_RMS_M.get((r["system"], int(r["nodes"])), ""))
        assert int(r["runs"]) == (6 if r["system"] == "static" else 2)


def test_every_expected_figure_is_listed(short):
    rows = read(short[0] / "expected.csv")
    assert len(rows) == 7 + len(EXPECTED_RMS_M) + len(PAPER_RMS_M)
    for r in rows:
        met = abs(float(r["measured"]) - float(r["expected"])) <= float(r["tolerance"])
        assert r["within"] == str(met)


def test_every_claim_has_a_verdict(short):
    rows = read(short[0] / "claims.csv")
    assert len(rows) == 18
    assert {r["verdict"] for r in rows} <= {HOLDS, UNDER_READING, NOT_REPRODUCED}


def test_progress_is_told_to_the_end(short):
    done, total, _ = zip(*short[1], strict=True)
    assert list(done) == list(range(1, total[0] + 1)) and set(total) == {len(done)}


def test_the_same_run_gives_the_same_tables(short, tmp_path):
    trial = SYSTEMS["pre_dc"].trial(225, 2)
    row = next(r for r in read(short[0] / "table2.csv") if (r["nodes"], r["system"]) == ("225", "pre_dc"))
    assert row["rms_m"] == f"{play(trial).rms_m().mean():.6g}"


def test_runs_do_not_depend_on_how_many_there_are():
    trial = Trial("pre_dc", scenario_as_read(particles=50, periods=5), 60)
    few = Trial("pre_dc", scenario_as_read(particles=50, periods=5), 3)
    assert np.array_equal(play(trial).estimate_m[:3], play(few).estimate_m)


def test_a_trial_named_twice_is_played_once():
    trial = Trial("nearest1", scenario_as_read(particles=10, periods=2), 2)
    told = []
    assert set(play_all([trial, trial], lambda *news: told.append(news))) == {trial}
    assert len(told) == 2


def test_verdicts():
    assert judge_claim(plainly=True, under_reading=True) == HOLDS
    assert judge_claim(plainly=False, under_reading=True) == UNDER_READING
    assert judge_claim(plainly=True, under_reading=False) == NOT_REPRODUCED


def test_a_difference_within_the_noise_does_not_count():
    rng = np.random.default_rng(0)
    a = rng.normal(size=100)
    assert exceeds(a + 0.01 * rng.normal(size=100) + 0.1, a)  # paired: small but sure
    assert not exceeds(a, a + 0.1 * rng.normal(size=100) + 0.1)
    assert not exceeds(rng.normal(size=50) + 0.01, a)
    assert exceeds(rng.normal(size=50) + 5, a)


def test_an_expectation_knows_its_tolerance():
    assert Expectation("p", 1.0, 0.1, 1.09).within and not Expectation("p", 1.0, 0.1, 0.89).within


def test_units_survive_the_terminal(tmp_path, capsys):
    show_table(tmp_path / "table2.md", "Table 2", ("policy", "RMS [m]"), [("a", "1")], "mean [m]")
    print_expected([Expectation("RMS [m] of a", 1.0, 0.1, 2.0)])
    assert capsys.readouterr().out.count("[m]") == 3


def test_an_unknown_paper_is_named():
    with pytest.raises(ValueError, match="pre_dk.*pre_dc"):
        reproduce("pre_dk", "unused")


@pytest.mark.parametrize("runs", [1, 0, -3, 2.5, True, "many"])
def test_too_few_runs_are_refused(runs, tmp_path):
    with pytest.raises(ValueError, match="at least 2"):
        reproduce("pre_dc", tmp_path, runs=runs)


def test_a_file_in_the_way_is_named(tmp_path):
    (tmp_path / "taken").write_text("")
    with pytest.raises(ValueError, match="taken"):
        reproduce("pre_dc", tmp_path / "taken", runs=2)


@pytest.mark.slow
@pytest.mark.full
def test_the_whole_reproduction(tmp_path):
    reproduce("pre_dc", tmp_path, runs=100, progress=silent)
    missed = {r["quantity"] for r in read(tmp_path / "expected.csv") if r["within"] != "True"}
    assert missed <= {"energy of static_cluster over pre_dc's, same tracker"}  # docs/reproduction.md says why
    cells = {(r["system"], int(r["nodes"])): r for r in read(tmp_path / "table2.csv")}
    rms = {cell: float(r["rms_m"]) for cell, r in cells.items()}
    for n in NODES:
        doubt = np.hypot(*(float(cells[name, n]["stderr_m"]) for name in ("pre_dc", "ekf")))
        assert rms["static", n] > max(rms["ekf", n], rms["pre_dc", n])
        assert rms["pre_dc", n] < rms["ekf", n] + 2 * doubt
        assert n == 121 or rms["pre_dc", n] < rms["ekf", n]
    assert all(rms["static", more] < rms["static", n] for n, more in pairwise(NODES))
    same = {r["policy"]: r for r in read(tmp_path / "same_tracker.csv")}
    static, pre_dc = same["static_cluster"], same["pre_dc"]
    assert float(static["rms_m"]) < float(pre_dc["rms_m"])
    assert float(static["energy_mj"]) > 2 * float(pre_dc["energy_mj"])
    verdicts = {r["claim"]: r["verdict"] for r in read(tmp_path / "claims.csv")}
    assert NOT_REPRODUCED not in verdicts.values()
