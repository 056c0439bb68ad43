"""What docs/errors.md and docs/reliability.md say: each message as it is, and the trials in a short form."""

import os
import subprocess
import sys

import numpy as np
import pytest

from studies.reliability import __main__ as reliability
from studies.reliability import hostile_files
from studies.reliability.kills import kill
from studies.reliability.messages import messages
from tests.figures import DOCS, found_blocks


@pytest.mark.skipif(sys.platform != "linux", reason="systems have words of their own")
def test_every_message_of_the_page_is_what_is_said():
    shown = {name: text for _, name, text in found_blocks((DOCS / "errors.md").read_text())}
    assert shown["reliability/messages"].strip() == messages().strip(), "run `python docs/figures.py reliability`"


@pytest.mark.parametrize("trial", ["files", pytest.param("memory", marks=pytest.mark.slow)])
def test_trials_in_a_short_form_find_nothing(trial, tmp_path, capsys):
    share = {"files": 0.05, "memory": 0.02}[trial]
    assert reliability.main(["--only", trial, "--share", str(share), "--seed", "1", "--out", str(tmp_path)]) == 0
    assert (tmp_path / f"{trial}.md").read_text() in capsys.readouterr().out


LONG = pytest.param("reproduce", "2 3", marks=[pytest.mark.slow, pytest.mark.full])


@pytest.mark.skipif(not hasattr(os, "fork"), reason="kills forks of itself")
@pytest.mark.parametrize(
    ("name", "moments"),
    [("evaluate", "2 5 9 14"), ("front", "4 12"), *((name, "2 3") for name in ("replay", "calibrate")), LONG],
)
def test_killed_at_some_files_the_same_command_ends_with_the_same_bytes(name, moments, tmp_path):
    """Trainings: test_train.py."""
    found = kill(name, tmp_path, "--blank", "--files", *moments.split())
    assert found == {"killed": len(moments.split()), "differ": []}


def test_a_reader_that_fails_is_told(monkeypatch, tmp_path, capsys):
    def fail(path):
        raise KeyError("inside")

    monkeypatch.setattr(hostile_files, "_read_policy", fail)
    assert reliability.main(["--only", "files", "--share", "0.001", "--out", str(tmp_path)]) == 1
    assert "policy.json, file 0: KeyError('inside')" in capsys.readouterr().err


def test_damage_is_damage():
    content = b"".join(b"%d,1.5,abc\n" % k for k in range(40))
    damaged = [hostile_files.damage(content, np.random.default_rng(k)) for k in range(100)]
    assert sum(each != content for each in damaged) > 95 and len(set(damaged)) > 90


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_memory_that_was_held_is_seen():
    def peak(made: str) -> float:
        """In a process of its own: this one has held more before."""
        code = f"from studies.reliability.memory import np, peak_mib; {made}; print(peak_mib())"
        return float(subprocess.run([sys.executable, "-c", code], capture_output=True, check=True).stdout)

    assert 54 < peak("np.ones(2**23)") - peak("pass") < 74  # 64 MiB


def test_an_unknown_trial_is_named(capsys):
    assert reliability.main(["--only", "fires"]) == 2
    assert "fires" in capsys.readouterr().err
