"""The studies' tables, from small runs."""

import re
import shutil
import sys

import numpy as np
import pytest

from studies import ablations, association, faults, lifetime, particles, seeds, tables, targets, worlds
from studies.report import draw_curves, learning_curve, over_seeds, table
from tests.figures import check_tables
from wsn_env import Scenario
from wsn_env.agents.ppo import PRETRAINED
from wsn_env.learning.held_out import HELD_OUT
from wsn_env.models.library import FAULTS
from wsn_env.models.quantity import parse_overrides
from wsn_env.scenario import named_scenarios

RIVALS = ("nearest0", "nearest1")
SMALL = "particles=50 nodes=40 side_m=50 crossing_m=20 periods=10".split()


def test_several_trainings_against_rules(tmp_path, monkeypatch, capsys):
    shipped = str(PRETRAINED / "PreDC-v0")
    asked = ["--policies", shipped, shipped, "--set", *SMALL, "--lam", "1", "4", "--episodes", "12"]
    asked += ["--rules", "nearest0", "nearest2", "pre_dc", "adaptive", "--out", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", ["seeds", *asked])
    assert seeds.main() == 0
    text, volumes = ((tmp_path / f"{name}.md").read_text() for name in ("table", "hypervolume"))
    shown = capsys.readouterr().out
    assert text.strip() in shown and volumes.strip() in shown
    own = re.search(r"\| \*\*PPO\*\*, one policy \| \*\*(-[\d.]+)\*\* \((-[\d.]+) to (-[\d.]+)\)", text)
    assert len(set(own.groups())) == 1  # twice the same policy
    assert re.search(r"\| best of nearest0\.\.2 \| [02]: -", text) and "| pre_dc | -" in text
    both = re.findall(r"\| ppo\d \| ([\d.]+) \|", volumes)
    assert len(both) == 2 and both[0] == both[1] and (tmp_path / "evaluation.csv").exists()


def test_a_table_gives_means_over_trainings_and_what_differs():
    usual = [{1.0: np.array([-10.0, -12.0])}, {1.0: np.array([-12.0, -14.0])}]
    other = [{1.0: np.array([-13.0, -13.4])}]
    assert over_seeds([-11.0, -13.0])[0] == -12.0
    assert over_seeds([-11.0, -13.0])[1] == pytest.approx(12.706 * 2**0.5 / 2**0.5, rel=1e-3)  # Student, one degree
    lines = table([1.0, 2.0], {"usual": usual, "other": other}, "usual").splitlines()
    assert lines[2].startswith("| usual | -12.0 ± 12.7 |") and lines[2].endswith("|  |")
    assert "-13.2 ± nan (-10.0 %)" in lines[3]


def test_one_policy_in_many_worlds_beside_the_best_rule_of_each(tmp_path, monkeypatch, capsys):
    """At lam = 0 nobody beats a rule that wakes nine; and a policy is level with itself under another name."""
    small = [" ".join(SMALL), " ".join([*SMALL, "noise_db=6"])]
    asked = ["--scenario", "Rssi-v0", "--policy", "nearest8", "--worlds", *small]
    asked += ["--lam", "0", "40", "--episodes", "200", "--out", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", ["worlds", *asked])
    monkeypatch.setattr(worlds, "RULES", RIVALS)
    assert worlds.main() == 0
    text = (tmp_path / "Rssi-v0.md").read_text()
    assert text.strip() in capsys.readouterr().out
    number = r"([+-][\d.]+)"
    cells = re.findall(rf"(\*\*)?{number} \[{number}, {number}\](\*\*)? (nearest\d)", text)
    assert len(cells) == 4 and {cell[-1] for cell in cells} <= set(RIVALS)
    precise, frugal = [float(cell[1]) for cell in cells[::2]], [float(cell[1]) for cell in cells[1::2]]
    assert min(precise) > 5 and max(frugal) < -100
    assert text.count("better in 2, worse in 2, better or less than 1 % worse in 2") == 2  # in hindsight, too


class Drawn:
    """An evaluation whose policies are equally good, but for the luck of the episodes."""

    def __init__(self, seed):
        self.policies = ["ppo", *(f"rule{i}" for i in range(21))]
        returns = np.random.default_rng(seed).normal(-100, 20, (22, 100))
        self._returns = dict(zip(self.policies, returns))

    def values(self, policy, lam, column):
        return self._returns[policy]

    def ranked(self, lam):
        return sorted(self.policies, key=lambda policy: -self._returns[policy].mean())


def test_a_policy_that_is_as_good_as_every_rule_is_not_behind_the_best_of_them():
    """But for chance; in hindsight it is: the best of 21 means of 100 is 1.9 standard errors (2 %) above the others."""
    leads = [worlds.lead_of("ppo", Drawn(seed), 1.0) for seed in range(100)]
    means = np.array([[cell.lead.mean, cell.hindsight.mean] for cell in leads])
    error = means.std(axis=0, ddof=1) / 10
    assert abs(means[:, 0].mean()) < 3 * error[0]
    assert means[:, 1].mean() == pytest.approx(-1.9 * 2, abs=3 * error[1] + 0.1)
    assert np.mean([cell.lead.high < 0 for cell in leads]) < 0.1 < np.mean([cell.hindsight.high < 0 for cell in leads])


@pytest.mark.parametrize("name", ["PreDC-v0", "Rssi-v0", "Binary-v0", "Anchors-v0", "Underwater-v0"])
def test_every_world_of_the_study_can_be_made(name):
    scenario = Scenario.named(name)
    made = {scenario.override(**parse_overrides(text.split())) for text in worlds.worlds_of(scenario).values()}
    assert len(made) == len(worlds.worlds_of(scenario)) and scenario in made


def test_variants_leave_out_the_usual_order_under_another_name():
    assert "order: nearest" not in ablations.variants(Scenario.named("PreDC-v0"))
    assert "order: information" not in ablations.variants(Scenario.named("Rssi-v0"))
    assert ablations.variants(Scenario.named("Rssi-v0"))[0] == ablations.USUAL


def progress(folder, begun: int, rows: list[tuple[int, str, str]]):
    """What train.py logs: periods, and the lead at two trade-offs, where it was taken."""
    path = folder / f"progress-{begun}" / "progress.csv"
    path.parent.mkdir(parents=True)
    names = f"time/total_timesteps,{HELD_OUT}1,{HELD_OUT}1_se,{HELD_OUT}4"
    path.write_text("\n".join([names, *(f"{periods},{one},,{four}" for periods, one, four in rows), ""]))


def test_learning_curves_join_resumed_runs_and_leave_out_where_none_was_taken(tmp_path):
    progress(tmp_path / "a", 0, [(10, "", ""), (20, "-9", "-5"), (30, "-6", "-4")])
    progress(tmp_path / "a", 30, [(40, "1", "3")])
    progress(tmp_path / "b", 0, [(20, "-8", "-5"), (40, "0", "2")])
    periods, lead = learning_curve(tmp_path / "a")
    assert periods.tolist() == [20, 30, 40] and lead.tolist() == [-7, -5, 2]
    draw_curves({"usual": [tmp_path / "a", tmp_path / "b"]}, "two runs", tmp_path / "curves.png")
    assert (tmp_path / "curves.png").stat().st_size > 10_000
    with pytest.raises(ValueError, match="nowhere: no progress"):
        learning_curve(tmp_path / "nowhere")


def test_the_pages_small_tables_are_what_is_measured(tmp_path):
    """A tenth of the episodes; those of shipped policies have a test of their own (test_pretrained.py)."""
    names = ["reference_points", "honesty", "silence", "motions", "anchors"]
    tables.main(["--episodes", "40", "--only", *names, "--out", str(tmp_path)])
    check_tables("filters.md", "tables", tmp_path, share=0.1)
    check_tables("comparing.md", "tables", tmp_path, share=0.1)
    check_tables("results.md", "tables", tmp_path, share=0.1)


def test_every_scenario_and_shipped_policy_is_in_a_table():
    """Lifetime-v0, where energy has no price, has a study of its own."""
    assert set(tables.COSTLY) == {name for name, scenario in named_scenarios().items() if scenario.lam}  # has a price
    priced = {path.parent.name for path in PRETRAINED.glob("*/policy.json")} & set(tables.COSTLY)
    assert {f"shipped_{name}" for name in priced} <= set(tables.TABLES)
    assert lifetime.LEARNED in lifetime.policies()


def test_an_unknown_table_is_named(capsys):
    assert tables.main(["--only", "honestly"]) == 2
    assert "honestly" in capsys.readouterr().err


def test_every_fault_is_played_at_three_strengths(tmp_path, monkeypatch):
    """The study in short: two faults, two filters, two episodes; a second call finds nothing left of the first."""
    assert faults.STRENGTHS.keys() == FAULTS.kinds.keys()
    assert all(len(settings) == 3 for settings in faults.STRENGTHS.values())
    monkeypatch.setattr(faults, "STRENGTHS", {name: faults.STRENGTHS[name] for name in ("late", "stops")})
    monkeypatch.setattr(faults, "FILTERS", {"plain filter": {}, "gate_sds=3": dict(gate_sds=3.0)})
    monkeypatch.setattr(faults, "POLICIES", ("nearest2", "ppo"))
    trained = tmp_path / "again"
    shutil.copytree(PRETRAINED / "PreDC-v0", trained)
    faults.main(["--episodes", "2", "--trained", str(trained), "--out", str(tmp_path / "out")])
    names = {"costs.png", *(f"{name}.md" for name in ("policies", "measures", "retrained", "filters"))}
    assert {path.name for path in (tmp_path / "out").iterdir()} == names
    rows = (tmp_path / "out" / "retrained.md").read_text().splitlines()[2:]
    assert len(rows) == 3 and all("+0.0 % (+0.0 to +0.0)" in row for row in rows)  # the same policy
    costs = (tmp_path / "out" / "policies.md").read_text().splitlines()
    assert len(costs) == 2 + 1 + 6 + 1 and costs[-1].startswith("| mean rank over the faults |")


def test_particles(tmp_path, capsys):
    assert particles.main(["--episodes", "40", "--out", str(tmp_path)]) == 0
    assert (tmp_path / "particles.md").read_text().strip() in capsys.readouterr().out
    check_tables("filters.md", "particles", tmp_path, share=40 / 500)


def test_association_in_short(tmp_path, capsys):
    assert association.main(["--episodes", "40", "--no-stone-soup", "--out", str(tmp_path)]) == 0
    assert (tmp_path / "meeting.md").read_text() in capsys.readouterr().out
    check_tables("targets.md", "association", tmp_path, share=40 / 500)


def test_several_targets_in_short(tmp_path, capsys):
    assert targets.main(["--episodes", "30", "--out", str(tmp_path)]) == 0
    assert (tmp_path / "return.md").read_text() in capsys.readouterr().out
    check_tables("targets.md", "multi", tmp_path, share=0.1)
