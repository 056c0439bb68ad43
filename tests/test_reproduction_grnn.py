"""The reproduction of the fingerprint system: its figures in a short form, its files, its verdicts."""

import csv

import numpy as np
import pytest

from tests.figures import check_tables
from wsn_env.papers import reproduce
from wsn_env.papers.claim import HOLDS, NOT_REPRODUCED, UNDER_READING
from wsn_env.papers.grnn.claims import EXPECTED_EQUAL_INFORMATION_M, EXPECTED_POOR_START_M, EXPECTED_RMSE_M
from wsn_env.papers.grnn.pitfalls import pitfalls
from wsn_env.papers.grnn.systems import (
    ANCHORS,
    METHODS,
    PERIODS_S,
    cramer_rao_bound,
    equal_information_trial,
    method_trial,
    start_trial,
    track,
)
from wsn_env.papers.rollout import exceeds, play

COLUMNS = {
    "rmse": "method,period_s,expected_m,rmse_m,stderr_m,rmse_x_m,rmse_y_m",
    "equal_information": "method,period_s,noise_db,rmse_m,stderr_m",
    "poor_start": "anchors,start,method,rmse_m,stderr_m",
    "width": "search,width_db,validation_rmse_m,evaluations",
    "bound": "anchors,static_bound_m",
    "pitfalls": "evaluation,rmse_m",
    "claims": "claim,paper,ours,verdict",
    "expected": "quantity,expected,tolerance,measured,within",
    "fig_start": "time_s," + ",".join(f"{a}_{m}_rms_m" for a in ANCHORS for m in ("ekf", "ckf", "ickf")),
    "fig_track": "period,target_x_m,target_y_m,grnn_x_m,grnn_y_m,grnn_kf_x_m,grnn_kf_y_m",
}
PICTURES = ("fig_period", "fig_start", "fig_track")


def read(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """Every file of the shortest run."""
    out = tmp_path_factory.mktemp("grnn")
    reproduce("grnn", out, runs=2, progress=lambda done, total, what: None)
    return out


@pytest.mark.parametrize("method", METHODS)
def test_the_main_table_in_its_short_form(method):
    for period_s, expected in zip(PERIODS_S[2:], EXPECTED_RMSE_M[method][2:], strict=True):
        rms, doubt = play(method_trial(method, period_s, 20)).pooled_rms_m()
        share = 0.03 if method == "grnn" else 0.10
        assert abs(rms - expected) < share * expected + 2 * doubt


@pytest.mark.parametrize(("anchors", "method"), EXPECTED_POOR_START_M)
def test_iteration_saves_a_poor_start(anchors, method):
    rms, doubt = play(start_trial(method, anchors, "field", 50)).pooled_rms_m()
    expected = EXPECTED_POOR_START_M[anchors, method]
    assert abs(rms - expected) < 0.1 * expected + 2 * doubt


def test_the_error_grows_with_the_period_only_where_samples_have_their_own_noise():
    slow, fast = (play(method_trial("ckf", t, 15)).rms_m() for t in (1.0, 0.2))
    assert exceeds(slow, fast)
    slow, fast = (play(equal_information_trial("ckf", t, 30)) for t in (1.0, 0.1))
    assert exceeds(fast.rms_m(), slow.rms_m())
    for record, t in ((slow, 1.0), (fast, 0.1)):
        rms, doubt = record.pooled_rms_m()
        assert abs(rms - EXPECTED_EQUAL_INFORMATION_M[t]) < 0.1 * EXPECTED_EQUAL_INFORMATION_M[t] + 2 * doubt


def test_with_a_fix_to_begin_with_iteration_changes_little():
    ckf, ickf = (play(method_trial(method, 0.5, 20)).pooled_rms_m()[0] for method in ("ckf", "ickf"))
    assert abs(ickf / ckf - 1) < 0.05


def test_the_bound_along_the_path():
    points = track(0.1)[1:, ::2]
    assert np.sqrt((cramer_rao_bound("ring8", points) ** 2).mean()) == pytest.approx(16.8, abs=0.1)
    # By hand, in the middle of the ring: four anchors at 100 m, four at 100 sqrt(2) m, each 10 n / (ln 10 d) a metre.
    information = (30 / np.log(10) / 3) ** 2 / 2 * (4 / 100**2 + 4 / (2 * 100**2))
    assert cramer_rao_bound("ring8", np.array([[100.0, 100]]))[0] == pytest.approx((2 / information) ** 0.5)


def test_leaking_evaluations_look_better_than_they_are():
    honest, reset, on_path, elsewhere, mirrored = (row[1] for row in pitfalls(5).rows)
    assert reset < 0.2 * honest and on_path < honest < elsewhere
    assert mirrored == pytest.approx(honest, rel=0.1)


@pytest.mark.parametrize("name", COLUMNS)
def test_every_table_is_written(short, name):
    text = (short / f"{name}.csv").read_text()
    assert text.splitlines()[0] == COLUMNS[name]
    assert "nan" not in text and "inf" not in text.replace("information", "")


def test_the_page_shows_what_is_written(short):
    check_tables("reproduction/grnn.md", "reproduce/grnn", short, share=2 / 100)


def test_nothing_else_is_left_behind(short):
    files = {f"{name}.csv" for name in COLUMNS} | {f"{name}.png" for name in PICTURES}
    assert {path.name for path in short.iterdir() if path.suffix != ".md"} == files
    assert all((short / f"{name}.png").read_bytes().startswith(b"\x89PNG") for name in PICTURES)


def test_every_expected_figure_and_claim_is_listed(short):
    rows = read(short / "expected.csv")
    assert len(rows) == 4 * len(EXPECTED_RMSE_M) + len(EXPECTED_POOR_START_M) + 4 + 2 + 5
    for row in rows:
        assert row["within"] == str(abs(float(row["measured"]) - float(row["expected"])) <= float(row["tolerance"]))
    assert len(read(short / "claims.csv")) == 8


@pytest.mark.slow
@pytest.mark.full
def test_the_full_form(tmp_path):
    reproduce("grnn", tmp_path, runs=100, progress=lambda done, total, what: None)
    assert {row["quantity"] for row in read(tmp_path / "expected.csv") if row["within"] != "True"} == set()
    verdicts = {row["claim"]: row["verdict"] for row in read(tmp_path / "claims.csv")}
    for name in ("GRNN + KF", "ICKF"):
        assert verdicts[f"the error of {name} grows with the sampling period"] == UNDER_READING
    assert verdicts["the errors in x and y cross over at T = 0.5 s"] == NOT_REPRODUCED
    assert verdicts["the combination of network and filter beats GRNN alone"] == HOLDS
    for anchors in ANCHORS:
        assert verdicts[f"iteration improves the cubature filter, {anchors}"] == UNDER_READING
    assert verdicts["fruit fly optimisation finds the network's best width"] == HOLDS
