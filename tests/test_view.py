"""Policies cannot touch the world: what a view shows is read-only and stays what it is; choices are node numbers."""

import numpy as np
import pytest

from wsn_env import Cluster, ClusterEnv, ClusterVectorEnv, Scenario, View, World, evaluate, make_policy
from wsn_env.cli import main
from wsn_env.envs.actions import ACTIONS

SMALL = Scenario.named("PreDC-v0", periods=6, particles=50, nodes=30, side_m=40.0, crossing_m=20.0)
SCENARIOS = (SMALL, Scenario.named("Binary-v0", periods=4), Scenario.named("Ble-v0", periods=4, particles=50))
SHOWN = (
    "period lam random_bits log_miss mean cov predicted_mean predicted_cov positions battery head alive member detected"
    " sees measured distance prediction row belief receivers"
).split()


def arrays_of(view):
    """All that a policy can get hold of."""
    nodes, distances = view.nearest(3)
    own = {name: getattr(view, name) for name in SHOWN} | {"nodes": nodes, "distances": distances}
    return own | {"leader": view.nearest_living()} | dict(view.knowledge.leaves())


class Writer:
    """Adds one to everything it finds, and copes with refusals."""

    def __init__(self, policy):
        self.policy, self.refused, self.written = policy, set(), set()

    def act(self, view):
        for name, array in arrays_of(view).items():
            try:
                array[...] = array if array.dtype.names or array.dtype == bool else array + 1
                self.written.add(name)
            except ValueError as problem:
                assert "read-only" in str(problem)
                self.refused.add(name)
        return self.policy.act(view)


class Keeper:
    """Keeps every view and every array, with copies of what they were."""

    def __init__(self, policy):
        self.policy, self.views, self.kept = policy, [], []

    def act(self, view):
        self.views.append(view)
        self.kept += [(array, array.copy()) for array in arrays_of(view).values()]
        return self.policy.act(view)

    def check(self):
        for array, copy in self.kept:
            np.testing.assert_array_equal(array, copy)
        for period, view in enumerate(self.views):
            assert (view.period == period).all()


@pytest.mark.parametrize("scenario", SCENARIOS, ids=lambda scenario: scenario.name)
def test_a_policy_cannot_write_into_the_world(scenario):
    honest, writer = make_policy("nearest1", scenario), Writer(make_policy("nearest1", scenario))
    rows = [evaluate({"p": policy}, scenario, [4.0], episodes=2).rows for policy in (honest, writer)]
    assert rows[0] == rows[1]
    assert writer.written == set()
    assert len(writer.refused) > 30


@pytest.mark.parametrize("scenario", SCENARIOS, ids=lambda scenario: scenario.name)
def test_what_a_policy_keeps_stays_what_it_was(scenario):
    keeper = Keeper(make_policy("nearest1", scenario))
    evaluate({"p": keeper}, scenario, [4.0], episodes=2)
    keeper.check()


@pytest.mark.interpreted
@pytest.mark.parametrize("make", [ClusterEnv, lambda scenario: ClusterVectorEnv(3, scenario)])
def test_views_of_environments_are_read_only_and_stay(make):
    env = make(SMALL)
    keeper = Keeper(Writer(make_policy("nearest1", SMALL)))
    env.reset(seed=1)
    first = env.view
    assert env.view is first
    for _ in range(SMALL.periods):
        keeper.act(env.view)
        before = env.unwrapped._state.copy()
        env.action_masks()
        for (name, now), (_, then) in zip(env.unwrapped._state.leaves(), before.leaves()):
            np.testing.assert_array_equal(now, then, name)
        env.step(5 if env.action_space.shape == () else np.full(3, 5))
    keeper.check()
    assert keeper.policy.written == set()
    env.reset(seed=2)
    keeper.check()
    assert (first.period == 0).all()


def test_setting_the_flag_again_does_not_reach_the_world():
    state = World(SMALL, threads=1).reset([1])
    before, view = state.copy(), View.of(state)
    for _, array in view.knowledge.leaves():
        array.flags.writeable = True
        array.fill(0)
    for (name, now), (_, then) in zip(state.leaves(), before.leaves()):
        np.testing.assert_array_equal(now, then, name)


def test_views_made_of_observations_are_read_only():
    view = View.from_arrays(ClusterEnv(SMALL, observation="view").reset(seed=1)[0])
    for name, array in arrays_of(view).items():
        assert not array.flags.writeable, name


@pytest.mark.interpreted
def test_the_error_names_the_line_of_the_policy(tmp_path, capsys):
    file = tmp_path / "mine.py"
    file.write_text(
        "from wsn_env.agents.base import ViewPolicy\n\nclass Thief(ViewPolicy):\n    def act(self, view):\n"
        "        offset = view.positions\n        offset -= offset[:, :1]\n"
    )
    assert main(["evaluate", "--policies", f"{file}:Thief", "--episodes", "1", "--set", "particles=50"]) == 2
    assert capsys.readouterr().err.strip() == f"wsn: {file}:6: output array is read-only"


class Chooses:
    def __init__(self, head, members):
        self.cluster = Cluster(head, members)

    def act(self, view):
        return self.cluster


GOOD = np.array([1, 2]), np.array([[3, -1], [4, 5]])
NO_NUMBERS = [
    [15.5, 1.0], [np.nan, 1.0], [np.inf, 1.0], [-2.5, 0.0], ["1", "2"], [None, None], [True, False], [1 + 0j, 2],
    [2**70, 1],
    np.array([15.5, 1], np.float32), np.array(["2020", "2021"], "M8[Y]"), [{}, {}], None, "12",
]  # fmt: skip


@pytest.mark.parametrize("wrong", NO_NUMBERS, ids=repr)
@pytest.mark.parametrize("part", ["head", "members"])
def test_what_is_no_whole_number_is_no_node(part, wrong):
    head, members = GOOD
    cluster = (
        (wrong, members) if part == "head" else (head, wrong if np.ndim(wrong) == 0 else [[each] for each in wrong])
    )
    with pytest.raises(
        ValueError, match=rf"^Chooses.act: cluster.{part} = .*: must be whole node numbers, an array"
    ) as e:
        evaluate({"p": Chooses(*cluster)}, SMALL, [4.0], episodes=2)
    assert "\n" not in str(e.value)
    world = World(SMALL, threads=1)
    with pytest.raises(ValueError, match=rf"^cluster.{part} = .*: must be whole node numbers"):
        world.step(world.reset([1, 2]), Cluster(*cluster))


@pytest.mark.parametrize(
    ("head", "members"),
    [
        (3, GOOD[1]), (GOOD[0][:, None], GOOD[1]), ([1, 2, 3], GOOD[1]), (GOOD[0], 3), (GOOD[0], [1, 2]),
        (GOOD[0], [[1]]), (GOOD[0], np.ones((2, 1, 1), int)), ([], GOOD[1]),
    ],
)  # fmt: skip
def test_a_choice_has_a_row_for_each_environment(head, members):
    with pytest.raises(
        ValueError, match=r"^Chooses.act: cluster has head .*: must be \(2,\), \(2, M\), a row for each"
    ):
        evaluate({"p": Chooses(head, members)}, SMALL, [4.0], episodes=2)


@pytest.mark.parametrize("lengths", [([[1], [1, 2]]), ([1, [2]])])
def test_lists_of_unequal_lengths_are_no_nodes(lengths):
    with pytest.raises(ValueError, match=r"^Chooses.act: cluster.members = \[.*\]: must be whole node numbers"):
        evaluate({"p": Chooses(GOOD[0], lengths)}, SMALL, [4.0], episodes=2)


@pytest.mark.parametrize("node", [-5, -4, 30, 31, 2**31, 2**40, -(2**40), np.uint64(2**64 - 1)])
@pytest.mark.parametrize("part", ["head", "members"])
def test_nodes_that_do_not_exist_are_refused_in_evaluations(part, node):
    array = np.array([node, 1]) if not isinstance(node, np.uint64) else np.array([node, 1], np.uint64)
    cluster = (array, GOOD[1]) if part == "head" else (GOOD[0], array[:, None])
    with pytest.raises(ValueError, match=rf"^Chooses.act: chose node {node}: must be below 30, and at least 0$"):
        evaluate({"p": Chooses(*cluster)}, SMALL, [4.0], episodes=2)


@pytest.mark.interpreted
@pytest.mark.parametrize(
    "dtype", [np.int8, np.uint8, np.int16, np.uint16, np.int32, np.uint32, np.int64, np.uint64, float]
)
def test_node_numbers_of_any_width_choose_the_same(dtype):
    head, members = GOOD[0], np.abs(GOOD[1])
    usual = evaluate({"p": Chooses(head, members)}, SMALL, [4.0], episodes=2).rows
    assert evaluate({"p": Chooses(head.astype(dtype), members.astype(dtype))}, SMALL, [4.0], episodes=2).rows == usual
    frozen = head.astype(dtype), members.astype(dtype)
    for array in frozen:
        array.flags.writeable = False
    assert evaluate({"p": Chooses(*frozen)}, SMALL, [4.0], episodes=2).rows == usual


def test_dead_and_repeated_nodes_are_still_dropped_and_counted():
    world = World(SMALL, threads=1)
    state = world.reset([1])
    state.residual_j[0, 3] = state.network.battery[0, 3] = 0.0
    _, outcome = world.step(state, Cluster([1], [[2, 2, 3, 30, 2**40, -7]]))
    assert outcome.row["dropped"][0] == 5
    assert world.step(state, Cluster(np.array([2**63], np.uint64), [[2]]))[1].row["dropped"][0] == 1


@pytest.mark.parametrize("chosen", [[[3, 5]], [[0.5]], [[np.nan]], [True], [["a"]]])
def test_masks_are_masks(chosen):
    with pytest.raises(ValueError, match="^Cluster.of: chosen = .*: must be a mask"):
        Cluster.of([0], chosen)


STRANGE = [
    15.5, -5, np.nan, "a", None, [1, 2, 3], [[1], [1, 2]], np.array("x"), [-1, -1], [np.nan, 1.0],
    [10**6] * 2, [2**70] * 2,
    {}, {"a": 1}, {"head": 1}, [{"head": 1}, {"members": 2}], [{"head": 1, "members": np.zeros(30, int)}, 3], object(),
    {"head": [15.5, 1.0], "members": np.zeros((2, 30), int)}, {"head": [1, -5], "members": np.zeros((2, 30), int)},
    {"head": [1, 2], "members": np.full((2, 30), 2)}, {"head": [1, 2], "members": np.zeros((2, 29), int)},
    {"head": ["a", "b"], "members": np.zeros((2, 30), int)}, {"head": [1, 2], "members": [[1], [1, 2]]},
]  # fmt: skip


@pytest.mark.interpreted
@pytest.mark.parametrize("mode", ACTIONS)
def test_environments_refuse_in_one_line_what_is_no_action(mode):
    envs, env = ClusterVectorEnv(2, SMALL, action=mode), ClusterEnv(SMALL, action=mode)
    for each in (envs, env):
        each.reset(seed=1)
        for action in STRANGE:
            with pytest.raises(ValueError, match="^action .* is not in .*, one for each row$") as problem:
                each.step(action)
            assert "\n" not in str(problem.value) and len(str(problem.value)) < 220
        assert each._state.period[0] == 0
