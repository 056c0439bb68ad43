"""The implementations compute the same, and their results become a page. (Nothing here looks at a clock.)"""

import subprocess
import sys

import numpy as np
import pytest
from rich.console import Console

from benchmarks import __main__ as suite
from benchmarks import environment, filter_scaling, filter_step, page, plots, race
from benchmarks.filters import (
    IMPLEMENTATIONS,
    SLOW_STARTERS,
    Absent,
    Implementation,
    Problem,
    agreement,
    enter,
    kind_of,
)
from benchmarks.filters.exact import estimates
from benchmarks.filters.textbook import ParticleFilter
from wsn_env.reports.markdown import block_names

MEASUREMENTS = ("position", "rssi")
NAMES = [
    pytest.param(name, marks=[pytest.mark.slow, pytest.mark.full] * (name in SLOW_STARTERS)) for name in IMPLEMENTATIONS
]


def skipping_absent(function, *arguments, **keywords):
    try:
        return function(*arguments, **keywords)
    except Absent as reason:
        pytest.skip(str(reason))


@pytest.mark.parametrize("measurement", MEASUREMENTS)
@pytest.mark.parametrize("name", NAMES)
def test_the_same_particles_and_reports_give_the_same_posterior(name, measurement):
    found = skipping_absent(agreement.noiseless_difference, name, measurement, particles=200, periods=3)
    assert found < kind_of(name).tolerance


@pytest.mark.parametrize("measurement", MEASUREMENTS)
@pytest.mark.parametrize("name", NAMES)
def test_with_their_own_noise_they_agree_to_monte_carlo_accuracy(name, measurement):
    found = skipping_absent(agreement.noisy_differences, name, measurement, particles=400, rows=8)
    assert len(found) == (17 if measurement == "position" else 9)
    assert max(map(abs, found.values())) < agreement.limit(len(found), 8), found


@pytest.mark.parametrize("measurement", MEASUREMENTS)
@pytest.mark.parametrize("change", [{"q": 1.25}, {"noise": 1.25}], ids=str)
def test_another_noise_is_noticed(change, measurement, monkeypatch):
    class Other(ParticleFilter):
        def __init__(self, *arguments):
            super().__init__(*arguments)
            for name, factor in change.items():
                setattr(self, name, factor * getattr(self, name))

    monkeypatch.setattr(kind_of("NumPy f64, textbook"), "kind", Other)
    found = agreement.noisy_differences("NumPy f64, textbook", measurement, particles=500, rows=10)
    assert max(map(abs, found.values())) > agreement.limit(len(found), 10), found


def test_the_check_is_the_same_every_time():
    runs = [agreement.noisy_differences("filterpy's book", "position", particles=50, rows=3) for _ in range(2)]
    assert runs[0] == runs[1]


@pytest.mark.parametrize("name", NAMES)
def test_every_implementation_steps_and_starts_over(name):
    implementation = skipping_absent(enter, name, Problem.draw("position", particles=200, rows=2))
    means, covs, n_eff = estimates(implementation, periods=22)
    assert means.shape == (22, 2, 4) and covs.shape == (22, 2, 4, 4) and n_eff.shape == (22, 2)
    assert np.isfinite(means).all() and (n_eff > 1).all() and (n_eff <= 200.1).all()


@pytest.mark.parametrize("measurement", MEASUREMENTS)
@pytest.mark.parametrize("particles", [64, 77])
def test_c_without_fused_products_gives_the_kernels_bits(measurement, particles):
    from benchmarks.filters.ours import Strict
    from benchmarks.filters.reference import ExactReference

    problem = Problem.draw(measurement, particles, rows=3)
    c = skipping_absent(ExactReference, problem)
    for left, right in zip(estimates(c), estimates(Strict(problem))):
        np.testing.assert_array_equal(left, right)


def test_fast_c_leaves_the_process_its_denormals():
    skipping_absent(enter, "C, -ffast-math", Problem.draw("position", particles=32)).step()
    assert np.full(3, 1e-310)[1] * 0.5 > 0.0


def test_an_implementation_that_is_not_here_is_skipped_by_name(monkeypatch):
    monkeypatch.setitem(IMPLEMENTATIONS, "nobody", ("nobody", "Nobody"))
    figures, absent = agreement.check_agreement(["nobody"], "position")
    assert figures == {} and "nobody" in absent["nobody"]


def test_another_posterior_is_not_raced(monkeypatch):
    monkeypatch.setattr(kind_of("NumPy f64, textbook").kind, "estimate", lambda self: (np.zeros(4), np.eye(4)))
    with pytest.raises(SystemExit, match="textbook does not compute the same posterior"):
        agreement.check_agreement(["NumPy f64, textbook"], "position")


def test_the_protocol_is_abstract():
    with pytest.raises(NotImplementedError):
        Implementation(Problem.draw(particles=10))


# --- the environments ---------------------------------------------------------------------------------------


def test_the_naive_environment_has_the_same_episodes():
    differences = environment.check_episodes("naive", environment.naive_episodes(8, 300), Console(quiet=True))
    assert set(differences) == {"rms_m", "energy_mj"}
    assert all(abs(value) < 3.0 for value in differences.values()), differences


def test_other_episodes_stop_the_race():
    other = environment.Episodes(np.full(4, 9.0) + np.arange(4), np.ones(4), particles=50)
    with pytest.raises(SystemExit, match="mine has other episodes"):
        environment.check_episodes("mine", other, Console(quiet=True))


def test_every_environment_steps():
    field, skipped = environment.implementations()
    assert len(field) + len(skipped) == len(environment.LABELS)
    for call, steps in field.values():
        assert steps in (1, environment.ROWS)
        call()


# --- the harness --------------------------------------------------------------------------------------------


def test_implementations_have_turns_in_every_round():
    order, now = [], iter(range(1000))
    calls = {name: lambda name=name: order.append(name) for name in "ab"}
    times = race.interleave(calls, race.Options(rounds=3), {"b": 2}, clock=lambda: next(now), warm=False)
    assert "".join(order) == "ababab"
    assert len(times.seconds["a"]) == 3
    assert times.ratio("a", "b") == 2.0 and times.spread("a", "b") == (2.0, 2.0)


def test_the_claims_verdicts():
    assert race.Claim("faster", 5.0, 5.0).verdict == "holds"
    assert race.Claim("faster", 5.0, 4.99).verdict == "missed"
    assert race.Claim("off the line", 20.0, 21.0, "%", at_most=True).cells()[1:] == ["<= 20 %", "21 %", "missed"]
    assert race.Claim("faster", 5.0, None, why="no peer").cells()[2:] == ["", "not measured: no peer"]


def test_the_line_is_found():
    sizes = [(p, rows) for p in (500, 5000) for rows in (10, 100)]
    grid = {(p, rows): 3e-6 + 5e-9 * p * rows for p, rows in sizes}
    assert filter_scaling.fit_line(grid) == pytest.approx((3e-6, 5e-9))


@pytest.fixture
def few(monkeypatch):
    """Claims without the slower implementations."""
    names = ("wsn_env, strict", "wsn_env, fast", "NumPy f32, tuned")
    chosen = {name: IMPLEMENTATIONS[name] for name in names} | {"nobody": ("nobody", "Nobody")}
    monkeypatch.setattr(filter_step, "IMPLEMENTATIONS", chosen)
    monkeypatch.setattr(filter_scaling, "RACED", list(chosen))
    monkeypatch.setitem(IMPLEMENTATIONS, "nobody", chosen["nobody"])
    monkeypatch.setattr(filter_scaling, "SHORT_LIMIT", 8000)
    monkeypatch.setattr(race, "SHORT_TURN_S", 0.0)


@pytest.mark.parametrize("claim", [filter_step, filter_scaling], ids=lambda claim: claim.__name__)
def test_a_short_run_becomes_a_page_that_renews_itself(claim, few, tmp_path):
    pytest.importorskip("matplotlib")
    console = Console(file=open(tmp_path / "log", "w"))
    result = claim.measure(race.Options(rounds=1, short=True), console)
    result.machine = race.machine_facts(result.packages)
    result.show(console)
    assert "nobody" in result.skipped and result.claims
    folder, text = tmp_path / "results", tmp_path / "performance.md"
    folder.mkdir()
    result.save(folder / f"{result.name}.json")
    assert race.Result.load(folder / f"{result.name}.json").claims == result.claims
    text.write_text(page.PAGE.read_text())
    page.renew_page(folder, text)
    first = text.read_text(), [path.read_bytes() for path in sorted(tmp_path.glob("*.svg"))]
    assert result.tables[0].title in first[0] and len(first[1]) == len(result.plots)
    page.renew_page(folder, text)
    assert (text.read_text(), [path.read_bytes() for path in sorted(tmp_path.glob("*.svg"))]) == first


def test_claims_that_differ_in_their_case_are_one_line_with_the_worst():
    cases = [race.Claim("faster", 5.0, value, case=case) for case, value in {"a": 7.0, "b": 4.0, "c": None}.items()]
    table = page.table_of_targets(
        [race.Result("speed", "Speed", claims=[*cases, race.Claim("flat", 2.0, 1.0, at_most=True)])]
    )
    assert "| faster | >= 5x | 4x | b (best of 2: 7x) | **missed, 1 not measured** |\n| flat | <= 2x | 1x |" in table


def test_the_page_has_a_place_for_every_claim():
    places = set(block_names(page.PAGE.read_text()))
    assert {*suite.CLAIMS, "machine", "targets", "plots", "further"} == places
    assert max(map(len, page.PAGE.read_text().splitlines())) <= 140


def test_whole_environments_are_lines_beside_the_filters():
    filters = race.Plot("rows", "Filters", "rows B", "filter steps/s", {"ours": [(1, 2.0)]})
    environments = race.Plot(
        "env_rows", "Environments", "rows B", "environment steps/s", {"vector environment": [(1, 1.0)]}
    )
    results = [race.Result("vector", "", plots=[environments]), race.Result("filter_scaling", "", plots=[filters])]
    assert [*page.make_plots(results)["rows"].lines] == ["ours", "vector environment"]


def test_a_claim_without_a_place_of_its_own_stands_under_further():
    text = "# Title\n<!-- begin further -->\nold\n<!-- end further -->\nprose\n"
    facts = {"processor": "a", "cores": 2, "l2_bytes": 2**20, "python": "3", "system": "b", "packages": {}}
    table = race.Table("Cost", ["nodes", "us"], [["225", "3"]])
    new = page.renew_blocks(text, [race.Result("nodes", "Nodes", tables=[table], machine=facts)])
    assert "old" not in new and new.endswith("prose\n")
    assert "## Nodes\n\nCost:\n\n| nodes | us |\n| --- | --: |\n| 225 | 3 |\n" in new


def test_labels_keep_their_distance():
    assert plots._move_apart([0.0, 0.1, 5.0], 1.0) == pytest.approx([-0.45, 0.55, 5.0])


def test_a_failing_claim_does_not_stop_the_others(monkeypatch, tmp_path):
    commands = {"bad": [sys.executable, "-c", "raise SystemExit(3)"], "good": [sys.executable, "-c", ""]}
    monkeypatch.setattr(suite, "CLAIMS", ("bad", "good"))
    monkeypatch.setattr(suite, "command", lambda claim, folder, options: commands[claim])
    monkeypatch.setattr(sys, "argv", ["benchmarks", "--short", "--folder", str(tmp_path)])
    assert suite.main() == 1


def test_a_short_run_from_the_command_line(tmp_path):
    command = suite.command("memory", tmp_path, ["--short", "--rounds", "1"])
    done = subprocess.run(command, capture_output=True, text=True, cwd=page.ROOT)
    assert done.returncode == 0, done.stderr
    result = race.Result.load(tmp_path / "memory.json")
    assert result.name == "memory" and result.machine["cores"] >= 1
    assert result.claims[0].holds  # sizes of arrays depend on no machine
    assert result.claims[1].measured is None or result.claims[1].measured > 0
