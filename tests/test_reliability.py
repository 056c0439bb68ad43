"""What docs/reliability.md says: each message as it is, and the trials in a short form."""

import os
import sys

import pytest

from studies.reliability import __main__ as reliability
from studies.reliability.kills import kill
from studies.reliability.messages import messages
from tests.figures import DOCS, found_blocks


@pytest.mark.skipif(sys.platform != "linux", reason="systems have words of their own")
def test_every_message_of_the_page_is_what_is_said():
    shown = {name: text for _, name, text in found_blocks((DOCS / "reliability.md").read_text())}
    assert shown["reliability/messages"].strip() == messages().strip(), "run `python docs/figures.py reliability`"


@pytest.mark.parametrize("trial", ["files", pytest.param("memory", marks=pytest.mark.slow)])
def test_trials_in_a_short_form_find_nothing(trial, tmp_path, capsys):
    share = {"files": 0.05, "memory": 0.05}[trial]
    assert reliability.main(["--only", trial, "--share", str(share), "--seed", "1", "--out", str(tmp_path)]) == 0
    assert (tmp_path / f"{trial}.md").read_text() in capsys.readouterr().out


@pytest.mark.skipif(not hasattr(os, "fork"), reason="kills forks of itself")
@pytest.mark.parametrize(
    ("name", "moments"),
    [("evaluate", "2 5 9 14"), ("front", "4 12"), *((name, "2 3") for name in ("replay", "calibrate", "reproduce"))],
)
def test_killed_at_some_files_the_same_command_ends_with_the_same_bytes(name, moments, tmp_path):
    """Trainings: test_train.py."""
    found = kill(name, tmp_path, "--blank", "--files", *moments.split())
    assert found == {"killed": len(moments.split()), "differ": []}


def test_an_unknown_trial_is_named(capsys):
    assert reliability.main(["--only", "fires"]) == 2
    assert "fires" in capsys.readouterr().err
