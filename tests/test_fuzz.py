"""The fuzzer in short: some seeds, what hypothesis finds, and all that has ever failed."""

from pathlib import Path
from random import Random

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.database import DirectoryBasedExampleDatabase

from tests import fuzz
from wsn_env import View, World
from wsn_env.envs import rewards
from wsn_env.models.quantity import check_quantity

KEPT = Path(__file__).parents[1] / ".hypothesis" / "fuzz"  # what failed here is tried again first
SEEDS = 60


@pytest.mark.parametrize("first", range(0, SEEDS, 20))
def test_the_laws_hold_for_a_fixed_share_of_seeds(first):
    played = [fuzz.play(fuzz.case_of(seed, usual=True)) for seed in range(first, first + 20)]
    assert sum(periods > 0 for periods in played) >= 10, "most are refused"


@settings(
    max_examples=60,
    deadline=None,
    database=DirectoryBasedExampleDatabase(KEPT),
    suppress_health_check=list(HealthCheck),
)
@given(st.randoms(use_true_random=False))
def test_the_laws_hold_for_what_hypothesis_draws(rng):
    fuzz.play(fuzz.draw_case(rng, usual=True))


@pytest.mark.parametrize("case", list(fuzz.kept_cases()), ids=str)
def test_what_has_failed_once_does_no_more(case):
    fuzz.play(case)


def test_a_seed_is_a_case_and_a_line_to_paste():
    case = fuzz.case_of(7)
    assert case == fuzz.case_of(7) != fuzz.case_of(8)
    line = str(case).removesuffix(f".reset(seed={case.seed})")
    assert eval(line, {"gym": Recorder}) == (f"wsn_env/{case.id}", case.keywords)


class Recorder:
    """Takes the place of gymnasium."""

    @staticmethod
    def make(name, **keywords):
        return name, keywords


def test_every_kind_and_quantity_is_drawn():
    cases = [fuzz.case_of(seed) for seed in range(3000)]
    drawn = {name for case in cases for name in case.keywords}
    parts = fuzz.replace_parts(fuzz.named_scenarios()["Ble-v0"], {})
    for role, registry in fuzz.BY_NAME.items():
        names = fuzz.without_files(role)
        assert {case.keywords.get(role) for case in cases} == {None, *names}
        assert registry.kinds.keys() - names <= {"recorded", "replay"}  # of files
        kinds = [registry.kinds[name]() for name in names]
        bounded = {
            item.name for kind in [*kinds, *parts.values()] for item in fuzz.fields(kind) if "allowed" in item.metadata
        }
        assert bounded <= drawn


def test_numbers_are_drawn_up_to_their_bounds_and_within():
    rng = Random(0)
    for allowed in (
        dict(above=0),
        dict(at_least=0, at_most=1),
        dict(at_least=1e-6, at_most=1e9),
        dict(at_least=-1000, at_most=1000),
        dict(at_least=0, below=0.5),
        {},
    ):
        numbers = [fuzz.within(fuzz.anywhere(rng, **allowed), False, **allowed) for _ in range(2000)]
        for number in numbers:
            check_quantity("Test", "number", number, **allowed)
        ends = {allowed.get("at_least"), allowed.get("at_most")} - {None}
        assert ends <= set(numbers)
        assert len({f"{number:.0e}"[1:] for number in numbers}) > 5  # orders of magnitude


@pytest.fixture
def small_case():
    choices = dict(action="menu", observation="candidates", reward="error", order="nearest")
    return fuzz.Case("PreDC-v0", dict(nodes=30, particles=50, periods=3) | choices, 3)


def test_broken_laws_are_seen(small_case, monkeypatch):
    assert fuzz.broken_law(small_case) == (3 * 2 * (fuzz.ROWS + 1), "")
    with monkeypatch.context() as patch:
        patch.setitem(rewards.COSTS, "error", lambda outcome, counted: outcome["error_m"] * np.nan)
        assert fuzz.broken_law(small_case)[1].startswith("AssertionError in check_numbers: info reward_error")
    with monkeypatch.context() as patch:
        whole = View.as_arrays
        patch.setattr(View, "as_arrays", lambda view: whole(view) | {"lam": view.lam[:, None] * 1e12})
        assert "observation 'view' outside of its space: lam" in fuzz.broken_law(small_case)[1]
    with monkeypatch.context() as patch:
        patch.setattr(World, "step", lambda *arguments, **options: {}["inside"])
        assert fuzz.broken_law(small_case)[1].startswith("KeyError")


def test_what_is_found_is_made_small_and_kept(small_case, tmp_path, monkeypatch):
    class Player:
        @staticmethod
        def broken_law(case):
            return 0, "Error in place: of these" if case.keywords.get("lam", 0) > 1 else ""

    monkeypatch.setattr(fuzz, "FOUND", tmp_path / "found.json")
    case = fuzz.replace(small_case, keywords=small_case.keywords | dict(noise_m=3.0, lam=2.0, legs=((1.0, 0.0, 0.0),)))
    small = fuzz.shrunk(case, "Error in place: of those", Player)
    assert small == fuzz.Case("PreDC-v0", dict(lam=2.0), 3)
    for number in (8, 9):
        fuzz.keep(number, case, "law")
    assert list(fuzz.kept_cases()) == [case, case]
    assert [entry["from"] for entry in fuzz.found()] == [8, 9]


def test_a_process_that_hangs_or_crashes_is_told(small_case, monkeypatch):
    player = fuzz.Player()
    assert player.broken_law(small_case)[1] == ""
    player._process.kill()
    assert "crashed" in player.broken_law(small_case)[1]
    monkeypatch.setattr(fuzz, "HANG_S", 0)
    assert player.broken_law(small_case)[1] == "no end within 0 s"
    player.stop()
