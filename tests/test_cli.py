"""The commands as a user types them."""

import csv
import subprocess
import sys

import pytest

from wsn_env.cli import main

SMALL = ["--set", "particles=50", "nodes=30", "side_m=50", "crossing_m=20", "periods=5"]


def test_evaluate_prints_a_table_and_writes_files(tmp_path, capsys):
    command = ["evaluate", "--scenario", "Rssi-v0", "--policies", "nearest2", "all", "--lam", "1", "4"]
    assert main([*command, "--episodes", "6", "--seed", "2", "--out", str(tmp_path), *SMALL]) == 0
    printed = capsys.readouterr().out
    assert "Rssi-v0, lam = 4 m/mJ, 6 paired episodes" in printed and "nearest2" in printed
    with open(tmp_path / "evaluation.csv") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 24 and rows[0]["seed"] == str(2**31 + 200_000)
    left = {"evaluation.csv", "evaluation.json", "evaluation.md", "report.html"}
    assert {path.name for path in tmp_path.iterdir()} == left
    assert (tmp_path / "evaluation.md").read_text().count("| nearest2 |") == 2


def test_evaluate_on_recorded_motion(tmp_path, capsys):
    track = tmp_path / "walk.csv"
    track.write_text("t,x,y\n0,0,0\n10,4,3\n20,4,9\n")
    arguments = ["evaluate", "--policies", "nearest1", "--episodes", "2", "--tracks", str(track)]
    assert main([*arguments, "--set", "particles=50", "periods=10"]) == 0
    track.write_text("t,x,y\n0,0,0\n10,nan,3\n")
    assert main([*arguments, "--set", "particles=50", "periods=10"]) == 2
    error = capsys.readouterr().err
    assert "walk.csv, line 3" in error and "finite" in error


@pytest.mark.parametrize(
    "arguments,words",
    [
        (["--policies", "predc"], ("predc", "pre_dc")),
        (["--policies", "missing/policy.json"], ("missing/policy.json", "does not exist")),
        (["--scenario", "Pre-v0"], ("Pre-v0", "PreDC-v0")),
        (["--lam", "-1"], ("lam", "-1")),
        (["--episodes", "0"], ("episodes", "0")),
        (["--set", "node=3"], ("node", "nodes")),
        (["--set", "nodes"], ("nodes", "name=value")),
        (["--set", "nodes=many"], ("nodes", "many", "whole number")),
        (["--tracks", "nowhere.csv"], ("nowhere.csv", "cannot be read")),
    ],
)
def test_bad_input_is_one_clear_line(arguments, words, capsys):
    assert main(["evaluate", *arguments]) == 2
    error = capsys.readouterr().err.strip()
    assert error.startswith("wsn: ") and "\n" not in error and all(word in error for word in words)


def test_module_and_console_script_are_the_same(tmp_path):
    arguments = ["evaluate", "--policies", "nearest0", "--episodes", "2", *SMALL]
    module = subprocess.run([sys.executable, "-m", "wsn_env", *arguments], capture_output=True, text=True, check=True)
    script = sys.executable.rpartition("/")[0] + "/wsn"
    assert subprocess.run([script, *arguments], capture_output=True, text=True, check=True).stdout == module.stdout
