"""Fronts and their hypervolumes: hand-computed figures, laws, paired intervals, files, the command."""

import csv
import json
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wsn_env import Scenario, ScenarioError, make_policy
from wsn_env.agents.base import ViewPolicy
from wsn_env.agents.nearest import Nearest
from wsn_env.cli import main
from wsn_env.evaluation.comparison import evaluate
from wsn_env.evaluation.front import (
    OTHERS,
    Point,
    find_fronts,
    hypervolume,
    hypervolumes,
    join_points,
    lam_sweep,
    reference_point,
    save_front,
)
from wsn_env.evaluation.intervals import Summary
from wsn_env.reports.front_plots import draw_fronts
from wsn_env.reports.pictures import write_picture
from wsn_env.scenario import named_scenarios

SMALL = dict(particles=50, nodes=40, side_m=50.0, crossing_m=20.0, periods=6)
SCENARIO = Scenario.named("PreDC-v0", **SMALL)
REFERENCE = (4.0, 1.0)
MEANS = st.lists(st.tuples(st.floats(0, 6), st.floats(0, 2)), min_size=1, max_size=8).map(np.array)


@dataclass(frozen=True)
class Thrifty(ViewPolicy):
    """The dearer energy is, the fewer nodes."""

    def act(self, view):
        return Nearest(self.scenario, n=4 if view.lam[0] < 1 else 1).act(view)


def points(errors, energies, policy="mine") -> list[Point]:
    """One point from the episodes' errors and energies."""
    return [Point(policy, None, np.stack([errors, energies], axis=-1))]


@pytest.fixture(scope="module")
def evaluation():
    policies = {name: make_policy(name, SCENARIO) for name in ("nearest3", "pre_dc", "nearest0", "nearest1")}
    return evaluate({"thrifty7": Thrifty(SCENARIO)} | policies, SCENARIO, [0.5, 2.0, 8.0], episodes=12, threads=1)


def test_hypervolume_by_hand():
    """Steps at errors 1, 2 and 3 m of energies 0.75, 0.5 and 0.25 mJ under the point (4 m, 1 mJ)."""
    front = np.array([[2.0, 0.5], [1.0, 0.75], [3.0, 0.25]])
    assert hypervolume(front, REFERENCE) == pytest.approx(3 * 0.25 + 2 * 0.25 + 1 * 0.25)
    assert hypervolume(np.array([[0.0, 0.0]]), REFERENCE) == 4.0
    beyond = np.array([[4.0, 0.1], [0.1, 1.0], [5.0, 0.0], [0.0, 7.0]])
    assert hypervolume(beyond, REFERENCE) == 0.0
    assert hypervolume(np.concatenate([front, beyond]), REFERENCE) == hypervolume(front, REFERENCE)


@given(MEANS, MEANS)
def test_more_points_never_lower_it_and_dominated_ones_add_nothing(some, more):
    alone, both = hypervolume(some, REFERENCE), hypervolume(np.concatenate([some, more]), REFERENCE)
    assert max(alone, hypervolume(more, REFERENCE)) <= both <= REFERENCE[0] * REFERENCE[1]
    worse = some + np.array([0.5, 0.25])
    assert hypervolume(np.concatenate([some, worse]), REFERENCE) == pytest.approx(alone, rel=1e-12, abs=1e-15)


def test_identical_fronts_do_not_differ_at_all():
    rng = np.random.default_rng(0)
    errors, energies = rng.gamma(4.0, 0.4, (5, 30)), rng.gamma(4.0, 0.1, (5, 30))
    some = join_points(points(*pair) for pair in zip(errors, energies))
    first, twin, others, union = hypervolumes(
        {"a": some, "b": some[::-1], "c": some[:3]}, REFERENCE
    )  # in another order, among other columns
    assert first.difference is None and twin.hypervolume == first.hypervolume
    assert twin.difference == union.difference == Summary(0.0, 0.0, 0.0)
    assert others.difference.high <= 0.0 and union.front == OTHERS


def test_intervals_of_one_point_are_those_of_its_rectangle_and_cover():
    """A point with a constant energy: the hypervolume is linear in the mean error, so its interval is known."""
    rng = np.random.default_rng(3)
    covered = 0
    for _ in range(20):
        errors = rng.normal(2.0, 0.5, 60)
        mine, its = hypervolumes(
            {"a": points(errors, np.full(60, 0.5)), "b": points(errors + 0.1, np.full(60, 0.5))}, REFERENCE
        )
        half = (mine.hypervolume.high - mine.hypervolume.low) / 2
        assert mine.hypervolume.mean == pytest.approx((4 - errors.mean()) * 0.5)
        assert half == pytest.approx(1.96 * errors.std() / 60**0.5 * 0.5, rel=0.15)
        assert its.difference.mean == pytest.approx(-0.05) and its.difference.high - its.difference.low < 1e-12
        covered += mine.hypervolume.low <= 1.0 <= mine.hypervolume.high
    assert covered >= 15  # 95 % of 20, less four standard errors


def test_rules_blind_to_lam_are_a_point_and_a_family_is_a_front(evaluation):
    found = find_fronts(evaluation)
    assert list(found) == ["thrifty7", "nearest0..3", "pre_dc"]
    assert [point.lam for point in found["thrifty7"]] == [0.5, 2.0, 8.0]
    assert [point.policy for point in found["nearest0..3"]] == ["nearest0", "nearest1", "nearest3"]
    assert {point.lam for point in found["nearest0..3"]} == {None}
    point = found["nearest0..3"][1]
    means = evaluation.summary("nearest1", 2.0)
    assert point.error == means["error_m"] and point.energy == means["energy_mj"]
    union = join_points([found["nearest0..3"], found["pre_dc"]])
    assert len(union) == 4 and hypervolumes(found, (9.0, 1.0))[-1].hypervolume.mean == pytest.approx(
        hypervolume([point.values.mean(axis=0) for point in union], (9.0, 1.0))
    )


def test_csv_holds_the_points_and_json_the_hypervolumes(evaluation, tmp_path):
    found = find_fronts(evaluation)
    reference = reference_point(SCENARIO)
    volumes = hypervolumes(found, reference)
    save_front(evaluation, found, volumes, tmp_path)
    with open(tmp_path / "front.csv") as file:
        rows = list(csv.DictReader(file))
    assert [(row["front"], row["policy"], row["lam"]) for row in rows[2:4]] == [
        ("thrifty7", "thrifty7", "8.0"),
        ("nearest0..3", "nearest0", ""),
    ]
    for row, point in zip(rows, join_points(found.values()), strict=True):
        for name, summary in (("error", point.error), ("energy", point.energy)):
            unit = {"error": "m", "energy": "mj"}[name]
            read = Summary(*(float(row[column]) for column in (f"{name}_{unit}", f"{name}_low", f"{name}_high")))
            assert read == summary
    saved = json.loads((tmp_path / "front.json").read_text())
    assert saved["reference"] == {"error_m": 1.5, "energy_mj": 0.4} and "moocore" in saved["versions"]
    assert [entry["front"] for entry in saved["hypervolumes"]] == [*found, OTHERS]
    for entry in saved["hypervolumes"][:-1]:
        means = np.array([[float(r["error_m"]), float(r["energy_mj"])] for r in rows if r["front"] == entry["front"]])
        assert entry["hypervolume"]["mean"] == pytest.approx(hypervolume(means, reference), rel=1e-12)
    assert saved["hypervolumes"][1]["difference_to_first"] == vars(volumes[1].difference)
    write_picture(tmp_path / "front.png", draw_fronts(evaluation, found))
    assert (tmp_path / "front.png").read_bytes()[:4] == b"\x89PNG"


def test_the_sweep_suits_the_scenario():
    lams = lam_sweep(Scenario.named("PreDC-v0"))
    assert lams == lam_sweep(Scenario.named("Rssi-v0")) == (0.3, 0.53, 0.95, 1.7, 3.0, 5.3, 9.5, 17.0, 30.0)
    for name, scenario in named_scenarios().items():
        lams = lam_sweep(scenario)
        assert len(lams) == 9 and (scenario.lam == 0 or lams[0] < scenario.lam < lams[-1]), name
    assert lam_sweep(Scenario.named("PreDC-v0", lam=(1, 16)), 5) == (1.0, 2.0, 4.0, 8.0, 16.0)


@pytest.mark.parametrize("name", named_scenarios())
def test_sensible_policies_stay_within_the_reference_point(name):
    """The head alone errs most, every node within sensing range costs most."""
    scenario = named_scenarios()[name]
    played = evaluate(["nearest0", "static_cluster"], scenario, episodes=10, threads=1)
    error, energy = reference_point(scenario)
    assert played.values("nearest0", scenario.lam, "error_m").mean() < error
    assert played.values("static_cluster", scenario.lam, "energy_mj").mean() < energy


@pytest.mark.parametrize("field", ["reference_error_m", "reference_energy_mj"])
def test_a_reference_point_is_above_zero(field):
    with pytest.raises(ScenarioError, match=f"Scenario.{field} = 0: must be a finite number at least 1e-09"):
        Scenario.named("PreDC-v0", **{field: 0})


def test_pareto_prints_tables_and_writes_files(tmp_path, capsys):
    command = ["evaluate", "--pareto", "--policies", "pre_dc", "nearest0", "nearest1", "all", "--episodes", "3"]
    small = ["--set", *(f"{name}={value}" for name, value in SMALL.items())]
    assert main([*command, "--out", str(tmp_path), *small]) == 0
    printed = capsys.readouterr().out
    assert "lam = 0.3 to 30 m/mJ, 3 paired episodes" in printed and "difference to pre_dc" in printed
    assert "nearest0..1" in printed and OTHERS in printed and "1.5 m and 0.4 mJ" in printed
    names = {f"evaluation.{kind}" for kind in ("csv", "json", "md")} | {f"front.{k}" for k in ("csv", "json", "png")}
    names.add("report.html")
    assert {path.name for path in tmp_path.iterdir()} == names
    with open(tmp_path / "evaluation.csv") as file:
        assert len(list(csv.DictReader(file))) == 9 * 4 * 3
    assert main([*command, "--lam", "2", *small]) == 0
    assert "lam = 2 m/mJ" in capsys.readouterr().out


def test_a_missing_library_is_one_clear_line(monkeypatch, capsys):
    monkeypatch.setattr("wsn_env.evaluation.front.find_spec", lambda name: None)
    assert main(["evaluate", "--pareto"]) == 2
    assert capsys.readouterr().err.strip() == "wsn: fronts need moocore: pip install 'wsn_env[front]'"
