"""The standard benchmark: what scores mean, what the package's references are, and the command."""

import csv
import re

import numpy as np
import pytest

from studies import leaderboard
from wsn_env import as_policy, cli, make_policy
from wsn_env.envs.registration import STANDARD
from wsn_env.evaluation import standard
from wsn_env.evaluation.rollout import BLOCK
from wsn_env.evaluation.standard import EPISODES, Reference, Scores, block_scores, play_standard, references, scores
from wsn_env.reports.standard_tables import standard_table


@pytest.fixture(scope="module")
def played():
    return play_standard(["random", "nearest2", "ppo"], "PreDC-v0", 100)


def test_the_package_has_references_for_every_scenario_and_trade_off():
    assert set(references()) == set(STANDARD)
    for name, known in references().items():
        scenario = standard.standard_scenario(name)
        assert set(known) == set(standard.standard_lams(scenario)) and standard.standard_name(scenario) == name
        for reference in known.values():
            assert reference.best_returns.shape == (EPISODES // BLOCK,) and reference.span > 0
            make_policy(reference.best, scenario)


def test_the_references_are_what_the_policies_play(played):
    """To the rounding of the file: a change of bits would be a new version of a scenario."""
    for lam, reference in references()["PreDC-v0"].items():
        if reference.best == "ppo":
            own = standard.block_returns(played, "ppo", lam)
            assert own == pytest.approx(reference.best_returns[:2], abs=1e-4)
    assert any(reference.best == "ppo" for reference in references()["PreDC-v0"].values())


def test_so_are_those_of_several_targets():
    for lam, reference in references()["Multi-v0"].items():
        if reference.best == "greedy":
            own = standard.block_returns(play_standard(["greedy"], "Multi-v0", 50), "greedy", lam)
            assert own == pytest.approx(reference.best_returns[:1], abs=1e-4)
            return
    pytest.fail("greedy is nowhere the best")


def test_random_choices_have_0_and_the_best_has_1(played):
    known = {
        lam: Reference("ppo", standard.block_returns(played, "ppo", lam), played.values("random", lam, "return").mean())
        for lam in played.lams
    }
    assert block_scores(played, "ppo", known) == pytest.approx(np.ones(2))
    assert block_scores(played, "random", known).mean() == pytest.approx(0.0, abs=1e-9)
    lams = played.lams
    expected = np.mean(
        [(played.values("nearest2", lam, "return").mean() - known[lam].random_return) / known[lam].span for lam in lams]
    )
    assert block_scores(played, "nearest2", known).mean() == pytest.approx(expected)


def test_the_aggregate_is_an_interquartile_mean():
    one = Scores("a", {"x": np.array([0.0, 1.0, 2.0, 3.0]), "y": np.array([4.0, 5.0, 6.0, 100.0])})
    assert one.aggregate().mean == pytest.approx(np.mean([2.0, 3.0, 4.0, 5.0]))
    assert one.aggregate().low < 3.5 < one.aggregate().high
    other = Scores("b", {"x": np.full(4, 9.0)})
    rows = standard_table([other, one]).splitlines()[2:]
    assert rows[0].startswith("| a | 3.500 [") and rows[1].startswith("| b |  | 9.000 |  |")


def test_the_command(tmp_path, capsys, monkeypatch):
    mine = tmp_path / "mine.py"
    mine.write_text(
        "from wsn_env.agents.nearest import Nearest\n"
        "class Two(Nearest):\n"
        "    def __init__(self, scenario):\n"
        "        super().__init__(scenario, n=2)\n"
    )
    asked = ["benchmark", "--policy", f"mine={mine}:Two", "nearest2", "--scenarios", "PreDC-v0", "Underwater-v0"]
    assert cli.main([*asked, "--episodes", "50", "--out", str(tmp_path / "out")]) == 0
    assert "written: " in capsys.readouterr().out
    with open(tmp_path / "out" / "benchmark.csv") as file:
        rows = {(row["policy"], row["scenario"]): float(row["score"]) for row in csv.DictReader(file)}
    assert {scenario for _, scenario in rows} == {"PreDC-v0", "Underwater-v0", "all"}
    assert rows["mine", "all"] == rows["nearest2", "all"]
    assert (tmp_path / "out" / "PreDC-v0" / "evaluation.csv").exists()
    assert not (tmp_path / "out" / "PreDC-v0" / "evaluation.blocks.jsonl").exists()
    for wrong, words in (
        (["--policy", "neare", "--out", str(tmp_path / "no")], "policy 'neare' is unknown"),
        (["--policy", "ppo", "--episodes", "70", "--out", str(tmp_path / "no")], "episodes = 70: must be a multiple"),
        (["--policy", "ppo", "--scenarios", "PreDC", "--out", str(tmp_path / "no")], "did you mean PreDC-v0"),
    ):
        assert cli.main(["benchmark", *wrong]) == 2
        assert words in capsys.readouterr().err


def test_a_model_of_another_toolkit_has_a_score():
    mine = as_policy(lambda observations: np.full(len(observations), 11))
    found = scores([play_standard({"mine": mine}, "PreDC-v0", 50)])[0]
    assert 0.0 < found.of("PreDC-v0").mean < 1.1


def test_the_leaderboard(tmp_path):
    """A policy has the score that it has alone."""
    assert leaderboard.main(["--scenarios", "Underwater-v0", "--episodes", "50", "--out", str(tmp_path)]) == 0
    rows = dict(re.findall(r"\| (\w+) \| .*? \| (-?[\d.]+) \|", (tmp_path / "leaderboard.md").read_text()))
    assert set(rows) == set(leaderboard.POLICIES)
    for name in ("nearest2", "greedy"):
        alone = scores([play_standard(name, "Underwater-v0", 50)])[0].of("Underwater-v0")
        assert rows[name] == f"{alone.mean:.3f}"


def test_the_page_shows_every_policy():
    text = (leaderboard.Path(__file__).parents[1] / "docs" / "leaderboard.md").read_text()
    for name in leaderboard.POLICIES:
        assert f"| {name} |" in text
