"""The Cramer-Rao reference of an episode: against independent computations, and as a law of information."""

import ast
import math
from pathlib import Path

import numpy as np
import pytest

from tests.test_env import same
from tests.worlds import choices, keys_of
from wsn_env import ClusterEnv, ClusterVectorEnv, Scenario, World, make_policy
from wsn_env.evaluation.comparison import evaluate
from wsn_env.evaluation.intervals import Summary
from wsn_env.evaluation.rollout import episodes, evaluation_seeds, rollout
from wsn_env.reports.pictures import write_picture
from wsn_env.reports.plots import draw_comparison
from wsn_env.reports.tables import format_markdown, print_tables
from wsn_env.simulation.reference import Reference, has_reference

PLAIN = dict(particles=50)


def played(scenario, rows=5, seed=3, policy="random", threads=1):
    """Of every period (periods + 1, B), the episodes' and with all nodes awake (B,); the states on the way."""
    reference, told, states = Reference(scenario, rows, threads), [], []
    world = World(scenario, threads=1)
    for state, outcome in episodes(
        make_policy(policy, scenario), world, range(seed, seed + rows), lambda s, _: told.append(reference.begin(s))
    ):
        told.append(reference.advance(state, outcome))
        states.append((state.copy(), outcome))
    return np.array(told), reference.episode_m(), reference.all_awake_m(state), states


def by_information(scenario, states, row, q, start_sds):
    """The recursion on J by NumPy, with slopes by differences of the mean level; (periods,) in m."""
    t, m = scenario.period_s, scenario.measurement
    f = np.kron(np.eye(2), [[1, t], [0, 1]])
    g = np.kron(np.eye(2), [[t * t / 2], [t]])
    j = np.diag([start_sds[0] ** -2.0, start_sds[1] ** -2.0] * 2)
    found = []
    for state, _ in states:
        j = np.linalg.inv(f @ np.linalg.inv(j) @ f.T + q * q * g @ g.T)
        x, y = state.track[row, state.period[row], [0, 2]]
        for node in state.reports.node[row, : state.reports.count[row]]:
            if hasattr(m, "noise_m"):
                j[0, 0] += m.noise_m**-2
                j[2, 2] += m.noise_m**-2
                continue
            a, b = state.network.positions[row, node]
            d, step = math.hypot(x - a, y - b), 1e-4
            slope = (m.mean_db(d + step) - m.mean_db(d - step)) / (2 * step) if d > m.floor_m else 0.0
            h = slope * np.array([x - a, 0, y - b, 0]) / d
            j += np.outer(h, h) / m.noise_db**2
        found.append(math.sqrt(np.linalg.inv(j)[[0, 2], [0, 2]].sum()))
    return np.array(found)


@pytest.mark.parametrize(
    ("name", "q", "start_sds"),
    [
        ("PreDC-v0", 0.025, (1.0, 0.1)),
        ("Rssi-v0", 0.025, (1.0, 0.1)),
        ("Anchors-v0", 0.5, (10.0, 1.0)),
        ("Underwater-v0", 0.01, (20.0, 1.0)),
    ],
)
def test_equals_the_information_form(name, q, start_sds):
    scenario = Scenario.named(name, **PLAIN, periods=40)
    told, episode_m, _, states = played(scenario)
    assert told[0] == pytest.approx(start_sds[0] * 2**0.5)
    for row in range(5):
        expected = by_information(scenario, states, row, q, start_sds)
        np.testing.assert_allclose(told[1:, row], expected, rtol=1e-6)
        assert episode_m[row] == pytest.approx(np.sqrt((expected**2).mean()), rel=1e-6)


def test_equals_the_kalman_filters_covariance():
    """Of filterpy, with the target's own q, on the same position reports."""
    scenario = Scenario.named("PreDC-v0", tracker="ekf", filter_q=0.025, search=False)
    told, _, _, states = played(scenario, rows=2, policy="nearest2")
    np.testing.assert_allclose(told[1:], [outcome.posterior_rms_m for _, outcome in states], rtol=1e-9)


def test_a_first_search_counts():
    """Two position reports at the start leave 2 m / sqrt(2) a direction, of a field that is wide."""
    scenario = Scenario.named("PreDC-v0", **PLAIN, start="search", periods=2)
    world = World(scenario, threads=1)
    state = world.reset(keys_of(0, 30))
    first, n = Reference(scenario, 30).begin(state), state.reports.count
    wide = 100**2 / 12
    assert n.max() > 1 and (state.period == 0).all()
    np.testing.assert_allclose(first, np.sqrt(2 / (1 / wide + n / 4)), rtol=1e-12)


@pytest.mark.parametrize("name", ["PreDC-v0", "Rssi-v0", "Anchors-v0", "Underwater-v0"])
@pytest.mark.parametrize("more", [{}, dict(start="search", packet_success=0.6)])
def test_no_schedule_is_below_the_reference_with_all_nodes_awake(name, more):
    """Information adds, episode by episode; and the reference with all nodes awake is the same whatever was done."""
    if name == "Underwater-v0":
        more = {key: value for key, value in more.items() if key == "start"}
    scenario = Scenario.named(name, **PLAIN, periods=30, **more)
    all_awake = []
    for policy in ("random", "nearest0", "all"):
        _, episode_m, all_awake_m, _ = played(scenario, rows=8, policy=policy)
        assert (all_awake_m <= episode_m * (1 + 1e-12)).all()
        all_awake.append(all_awake_m)
    assert (all_awake[0] == all_awake[1]).all() and (all_awake[0] == all_awake[2]).all()
    if name != "Underwater-v0" and not more:  # everybody awake, nothing lost: that is it
        np.testing.assert_allclose(episode_m, all_awake_m, rtol=1e-12)


def test_the_kalman_filter_reaches_it():
    """With positions, the target's own q and tracks of its model: up to what who reports adds."""
    scenario = Scenario.named("PreDC-v0", tracker="ekf", motion="free", search=False)
    rows = rollout(make_policy("nearest4", scenario), World(scenario, threads=1), evaluation_seeds(5, 50))
    square, reference = (np.array([row[column] for row in rows]) ** 2 for column in ("rms_m", "reference_m"))
    error = (square - reference).std(ddof=1) / len(rows) ** 0.5
    assert abs((square - reference).mean()) <= 0.05 * reference.mean() + 3 * error


@pytest.mark.parametrize(
    ("name", "overrides", "there"),
    [
        ("PreDC-v0", {}, True),
        ("Rssi-v0", dict(silent_information=True), True),
        ("Anchors-v0", {}, True),
        ("PreDC-v0", dict(motion="sine", start="search"), True),
        ("Underwater-v0", {}, True),
        ("Binary-v0", {}, False),
    ],
)
def test_where_it_is(name, overrides, there):
    scenario = Scenario.named(name, **overrides)
    assert has_reference(scenario) == there
    env = ClusterEnv(scenario, particles=50, periods=2)
    _, first = env.reset(seed=0)
    env.step(10)
    *_, last = env.step(10)
    assert ("reference_m" in first) == ("reference_m" in last) == there
    assert ("episode_reference_m" in last) == there
    if there:
        assert 0 < env.reference_all_awake_m() <= last["episode_reference_m"] * (1 + 1e-12)
    else:
        with pytest.raises(ValueError, match="Binary"):
            Reference(scenario)
        with pytest.raises(ValueError, match="Binary"):
            env.reference_all_awake_m()


def test_a_motion_without_noise_takes_the_filters():
    sine = Scenario.named("PreDC-v0", motion="sine")
    assert sine.track_q == 0.2 and sine.override(filter_q=0.07).track_q == 0.07
    assert Scenario.named("PreDC-v0", filter_q=0.07).track_q == 0.025


@pytest.mark.parametrize("name", ["PreDC-v0", "Rssi-v0", "Underwater-v0"])
def test_rows_stand_alone(name):
    """A row of a batch, in any order, with one thread or two, is a batch of one, to the bit."""
    scenario = Scenario.named(name, **PLAIN, periods=6)
    keys, order = keys_of(1, 700), np.random.default_rng(0).permutation(700)

    def run(keys, pick, threads=1):
        world, reference = World(scenario, threads=1), Reference(scenario, len(keys), threads)
        state, told = world.reset(keys), []
        reference.begin(state)
        for period in range(6):
            heads, members = choices(0, period, 700, scenario.field.nodes)
            state, outcome = world.step(state, type(choices(0, 0, 1, 2))(heads[pick], members[pick]), donate=True)
            told.append(reference.advance(state, outcome))
        return np.array([*told, reference.episode_m(), reference.all_awake_m(state)])

    batch = run(keys, np.arange(700))
    assert (batch == run(keys, np.arange(700), threads=2)).all()
    assert (batch[:, order] == run(keys[order], order)).all()
    for row in (0, 13, 699):
        assert (batch[:, [row]] == run(keys[row : row + 1], [row])).all()


@pytest.mark.parametrize("name", ["Rssi-v0", "Underwater-v0", "Binary-v0"])
@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_infos_of_vector_and_single_agree(name, mode):
    more = dict(start="search") if name == "Rssi-v0" else {}
    settings = dict(scenario=name, particles=50, periods=4, **more)
    envs, env = ClusterVectorEnv(3, autoreset_mode=mode, **settings), ClusterEnv(**settings)
    infos, info = envs.reset(seed=8)[1], env.reset(seed=9)[1]
    for _ in range(4):
        assert {key: infos[key][1] for key in info if "reference" in key} == {
            k: info[k] for k in info if "reference" in k
        }
        *_, infos = envs.step(np.full(3, 12))
        *_, info = env.step(12)
    last = infos["final_info"] if mode == "SameStep" else infos
    for key in ("reference_m", "episode_reference_m"):
        assert (key in last) == (key in info)
        assert key not in info or last[key][1] == info[key]
    if mode == "NextStep" and "reference_m" in info:
        assert envs.reference_all_awake_m()[1] == env.reference_all_awake_m()
    again = env.reset()[1]
    if mode == "NextStep":
        *_, infos = envs.step(np.full(3, 12))
    assert "reference_m" not in again or infos["reference_m"][1] == again["reference_m"]


def test_nothing_of_it_reaches_who_decides():
    """It is made of the truth: no policy, observation, action, reward or tracker may import it, nor does one see it."""
    root = Path(__file__).parents[1]
    folders = [sorted((root / folder).glob("*.py")) for folder in ("agents", "wsn_env/envs", "wsn_env/filters")]
    assert all(folders)
    for path in (path for folder in folders for path in folder if path.name not in ("env.py", "vector_env.py")):
        assert not {"bound", "reference"} & {
            part
            for node in ast.walk(ast.parse(path.read_text()))
            if isinstance(node, (ast.Import, ast.ImportFrom))
            for part in [*(getattr(node, "module", "") or "").split("."), *(name.name for name in node.names)]
        }, path
    settings = dict(particles=50, periods=5, observation="view")
    told, untold = ClusterEnv(**settings), ClusterEnv(**settings)
    untold._reference = None
    assert same(told.reset(seed=0)[0], untold.reset(seed=0)[0])
    assert all(same(told.step(12)[0], untold.step(12)[0]) for _ in range(5))


def test_the_ratio_and_its_interval():
    rng = np.random.default_rng(0)
    reference = rng.uniform(1, 2, 400)
    ratio = Summary.of_root_ratio(1.21 * reference, reference)
    assert (ratio.mean, ratio.low, ratio.high) == pytest.approx((1.1, 1.1, 1.1))
    noisy = Summary.of_root_ratio(1.21 * reference * rng.uniform(0.5, 1.5, 400), reference)
    assert noisy.low < 1.1 < noisy.high < 1.15
    one = Summary.of_root_ratio([4.0], [1.0])
    assert (one.mean, one.low, one.high) == (2, 2, 2)


@pytest.mark.parametrize(
    ("name", "column", "words"),
    [
        ("PreDC-v0", "RMS / reference", "which an estimate may beat"),
        ("Underwater-v0", "RMS / reference", "which an estimate may beat"),
        ("Binary-v0", None, "no Cramer-Rao reference"),
    ],
)
def test_tables_say_what_it_is(name, column, words, tmp_path, capsys):
    evaluation = evaluate(["nearest2", "nearest3"], Scenario.named(name, particles=50, periods=4), episodes=4)
    head, _, *lines = format_markdown(evaluation, evaluation.lams[0], "nearest2").splitlines()
    assert ("RMS /" in head) == (column is not None) and (column or "") in head
    assert all(line.count("|") == head.count("|") for line in lines)
    print_tables(evaluation)
    assert words in " ".join(capsys.readouterr().out.split())
    write_picture(tmp_path / "front.png", draw_comparison(evaluation, evaluation.lams[0]))
    row = evaluation.rows[0]
    assert (row["reference_m"] == "") == (row["reference_all_awake_m"] == "") == (column is None)
    if column:
        ratio = evaluation.rms_over_reference("nearest2", evaluation.lams[0])
        rms, reference = (evaluation.values("nearest2", evaluation.lams[0], key) for key in ("rms_m", "reference_m"))
        assert ratio.mean == pytest.approx(np.sqrt((rms**2).mean() / (reference**2).mean()))
    evaluation.save(tmp_path)
    assert ("rms_over_" in (tmp_path / "evaluation.json").read_text()) == (column is not None)
