"""The studies' tables, from small runs."""

import re
import sys

import numpy as np
import pytest

from agents.ppo import PRETRAINED
from studies import seeds
from studies.report import over_seeds, table

SMALL = "particles=50 nodes=40 side_m=50 crossing_m=20 periods=10".split()


def test_several_trainings_against_rules(tmp_path, monkeypatch, capsys):
    shipped = str(PRETRAINED / "PreDC-v0")
    asked = ["--policies", shipped, shipped, "--set", *SMALL, "--lam", "1", "4", "--episodes", "12"]
    asked += ["--rules", "nearest0", "nearest2", "pre_dc", "adaptive", "--out", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", ["seeds", *asked])
    assert seeds.main() == 0
    text = (tmp_path / "seeds.md").read_text()
    assert text.strip() in capsys.readouterr().out
    own = re.search(r"\| \*\*PPO\*\*, one policy \| \*\*(-[\d.]+)\*\* \((-[\d.]+) to (-[\d.]+)\)", text)
    assert len(set(own.groups())) == 1  # twice the same policy
    assert re.search(r"\| best of nearest0\.\.2 \| [02]: -", text) and "| pre_dc | -" in text
    both = re.findall(r"- ppo\d: ([\d.]+); ", text)
    assert len(both) == 2 and both[0] == both[1] and (tmp_path / "evaluation.csv").exists()


def test_a_table_gives_means_over_trainings_and_what_differs():
    usual = [{1.0: np.array([-10.0, -12.0])}, {1.0: np.array([-12.0, -14.0])}]
    other = [{1.0: np.array([-13.0, -13.4])}]
    assert over_seeds([-11.0, -13.0])[0] == -12.0
    assert over_seeds([-11.0, -13.0])[1] == pytest.approx(12.706 * 2**0.5 / 2**0.5, rel=1e-3)  # Student, one degree
    lines = table([1.0, 2.0], {"usual": usual, "other": other}, "usual").splitlines()
    assert lines[2].startswith("| usual | -12.0 ± 12.7 |") and lines[2].endswith("|  |")
    assert "-13.2 ± nan (-10.0 %)" in lines[3]
