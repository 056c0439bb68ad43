"""Episodes played and measured: by seed, as rows of a batch, in blocks of 50 whatever the machine."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from wsn_env.compiled import draws
from wsn_env.evaluation.correspondence import Correspondence
from wsn_env.evaluation.policies import Policy
from wsn_env.models.quantity import whole_number
from wsn_env.models.state import NOBODY, Cluster, Outcome, State
from wsn_env.scenario import Scenario
from wsn_env.simulation.lifetime import METRICS, lifetimes
from wsn_env.simulation.reference import Reference, has_reference
from wsn_env.simulation.view import View
from wsn_env.simulation.world import World

BLOCK = 50
FIRST_SEED, SEEDS_PER_RUN = 2**31, 10**5  # training seeds lie below FIRST_SEED


def evaluation_seeds(seed: int, episodes: int) -> list[int]:
    """The literal reset seeds of an evaluation; `gym.make(...).reset(seed=s)` replays episode s."""
    seed, episodes = whole_number("seed", seed, 0, 10**4 - 1), whole_number("episodes", episodes, 1, SEEDS_PER_RUN)
    return [FIRST_SEED + seed * SEEDS_PER_RUN + episode for episode in range(episodes)]


def episodes(
    policy: Policy, world: World, seeds: Sequence[int], begin: Callable[[State, Outcome], object] | None = None
) -> Iterator[tuple[State, Outcome]]:
    """Play one episode for each seed, a row for each of its targets; gives state and outcome after every period.

    `begin` is called with state and outcome before the first: those of `World.restart`.
    """
    keys = np.repeat([draws.key_of_seed(seed) for seed in seeds], world.scenario.targets)
    state, outcome = world.restart(world.allocate(len(keys)), np.ones(len(keys), bool), keys, donate=True)
    if begin is not None:
        begin(state, outcome)
    for _ in range(world.scenario.periods):
        cluster = _check_cluster(policy.act(View.of(state)), policy, state.rows, world.scenario.field.nodes)
        state, outcome = world.step(state, cluster, donate=True)
        yield state, outcome


def _check_cluster(cluster: Cluster, policy: Policy, rows: int, nodes: int) -> Cluster:
    """What a policy chose; the world would drop and count nodes that do not exist, here they are a mistake."""
    if not isinstance(cluster, Cluster):
        chose = type(cluster).__name__
        raise ValueError(f"{type(policy).__name__}.act: returned a {chose}: must be a Cluster(head, members)")
    try:
        heads, members = cluster.check(rows)
    except ValueError as problem:
        raise ValueError(f"{type(policy).__name__}.act: {problem}") from None
    for chosen, lowest in ((heads, NOBODY), (members, -1)):
        least, highest = int(chosen.min(initial=0)), int(chosen.max(initial=0))
        if least < lowest or highest >= nodes:
            wrong = least if least < lowest else highest
            raise ValueError(f"{type(policy).__name__}.act: chose node {wrong}: must be below {nodes}, and at least 0")
    return Cluster(heads, members)


def rollout(policy: Policy, world: World, seeds: Sequence[int]) -> list[dict[str, Any]]:
    """Play one episode for each seed and measure it.

    Args:
        policy: sees only views.
        world: of a scenario with one lam.
        seeds: reset seeds, one a row.

    Returns: the measured columns of each episode, and the sums that its return is made of. `anees` is the average
    normalised estimation error squared of the position (Bar-Shalom, Li & Kirubarajan, 2001, sec. 5.4), e' P^-1 e / 2:
    1 where the filter is honest, more where it is too sure. `variance_ratio` is the mean of e' e / trace(P), which one
    thin direction of P cannot dominate. Both leave out the unscored periods, as `rms_m` does. Of an episode that ends
    outside the field all means are over the periods played, and the sums hold the charge for those left.

    `error_m` is the mean of errors as they count (`Scenario.counted_m`), `rms_m` of errors as they are. How long the
    network lasted is told by `lifetimes`. With several targets errors are means over them, counts, energies and returns
    sums, and `gospa_m`, `swaps` and `lost_tracks` are those of a Correspondence whose cut-off is the sensing radius;
    "" with one.
    """
    scenario, targets = world.scenario, world.scenario.targets
    rows = len(seeds) * targets
    names = "error", "square", "energy", "members", "handovers", "searches", "lost"
    sums: dict[str, Any] = dict.fromkeys(names, 0.0)
    counted_periods, ratios = np.zeros(rows), np.zeros(rows)
    regular_periods, nees_sums = np.zeros(rows), np.zeros(rows)
    reference = Reference(scenario, rows, world.threads) if has_reference(scenario) else None
    begin = None if reference is None else lambda state, _: reference.begin(state)
    playing, played = np.ones(rows, bool), np.zeros(rows, int)
    followed = Correspondence(len(seeds), targets, scenario.radius_m)
    lives: dict[str, np.ndarray] = dict.fromkeys(METRICS, np.zeros(rows))
    for state, outcome in episodes(policy, world, seeds, begin):
        square, believed = outcome.error_m**2, outcome.posterior_rms_m**2
        played += playing
        sums["error"] += playing * scenario.counted_m(outcome.error_m)
        if state.period[0] > scenario.unscored:
            sums["square"] += playing * square
            nees, regular = _position_nees(state, outcome)
            nees_sums += playing * nees
            regular_periods += playing & regular
            counted_periods += playing & (believed > 0)
            ratios += np.divide(square, believed, out=np.zeros(rows), where=playing & (believed > 0))
        sums["energy"] += playing * outcome.energy_mj
        sums["members"] += playing * outcome.members
        sums["handovers"] += playing & outcome.handover
        sums["searches"] += playing & outcome.searched
        sums["lost"] += playing & (outcome.error_m > 2 * scenario.radius_m)
        left_now = playing & world.left(state)
        if left_now.any() or state.period[0] == scenario.periods:  # episodes that end
            for name, values in lifetimes(state, scenario.periods).items():
                lives[name] = np.where(playing, values, lives[name])
        playing &= ~left_now
        if reference is not None:
            reference.advance(state, outcome)
        if targets > 1:
            followed.note(outcome.estimate_m, outcome.target_m)
    left = scenario.periods - played
    error, energy = (
        sums["error"] + left * scenario.reference_error_m,
        sums["energy"] + left * scenario.reference_energy_mj,
    )
    columns = {
        "lam": state.lam,
        "periods": played,
        "return": -(error + state.lam * energy),
        "sum_error_m": error,
        "sum_energy_mj": energy,
        "error_m": sums["error"] / played,
        "rms_m": np.sqrt(sums["square"] / (played - scenario.unscored)),
        "energy_mj": sums["energy"] / played,
        "members": sums["members"] / played,
        "handovers": sums["handovers"].astype(int),
        "searches": sums["searches"].astype(int),
        "lost": sums["lost"].astype(int),
        **lives,
        "reference_m": np.full(rows, "") if reference is None else reference.episode_m(),
        "reference_all_awake_m": np.full(rows, "") if reference is None else reference.all_awake_m(state),
        "anees": nees_sums / np.maximum(regular_periods, 1),
        "variance_ratio": ratios / np.maximum(counted_periods, 1),
    }
    if targets > 1:
        columns = {name: OVER_TARGETS[name](each.reshape(-1, targets), axis=1) for name, each in columns.items()}
    for name in IDENTITY:
        columns[name] = getattr(followed, name) if targets > 1 else np.full(len(seeds), "")
    return [{name: values[i].item() for name, values in columns.items()} for i in range(len(seeds))]


def _root_mean_square(values: np.ndarray, axis: int) -> np.ndarray:
    return np.sqrt((values * values).mean(axis=axis)) if values.dtype.kind == "f" else values[:, -1]  # "": none


def _shared(values: np.ndarray, axis: int) -> np.ndarray:
    return values[:, -1]


IDENTITY = ("gospa_m", "swaps", "lost_tracks")  # of several targets
OVER_TARGETS: dict[str, Callable[..., np.ndarray]] = {  # how a column of a field is made of those of its targets
    **dict.fromkeys(("return", "sum_error_m", "sum_energy_mj", "energy_mj"), np.sum),
    **dict.fromkeys(("members", "handovers", "searches", "lost"), np.sum),
    **dict.fromkeys(("error_m", "tracked", "anees", "variance_ratio"), np.mean),
    **dict.fromkeys(("rms_m", "reference_m", "reference_all_awake_m"), _root_mean_square),
    **dict.fromkeys(("lam", "periods", "first_death", "half_dead", "stranded_mj", "stranded_sd"), _shared),
    "functional": np.min,
}


def _position_nees(state: State, outcome: Outcome) -> tuple[np.ndarray, np.ndarray]:
    """(B,) e' P^-1 e / 2 of the position in a period, 0 where P has no inverse; (B,) bool, where it has one."""
    x, y = (outcome.estimate_m - outcome.target_m).T
    cov = state.belief.cov
    xx, xy, yy = cov[:, 0, 0], cov[:, 0, 2], cov[:, 2, 2]
    determinant = xx * yy - xy * xy
    regular = determinant > 1e-12 * xx * yy
    squares = 0.5 * (yy * x * x - 2.0 * xy * x * y + xx * y * y)
    return np.divide(squares, determinant, out=np.zeros(len(x)), where=regular), regular


def change_lam(measured: Sequence[dict[str, Any]], lam: float) -> list[dict[str, Any]]:
    """The same episodes with the return at another lam: what `rollout` gives of a policy that does not look at it."""
    return [
        values | {"lam": lam, "return": -(values["sum_error_m"] + lam * values["sum_energy_mj"])} for values in measured
    ]


class Block(NamedTuple):
    """Up to BLOCK episodes of a policy: what an engine plays at a time."""

    name: str
    lam: float | None  # that the policy sees; None: it does not look, and this serves all
    number: int
    policy: Policy
    scenario: Scenario
    seeds: list[int]


Engine = Callable[
    [Sequence[Block]], Iterator[tuple[Block, list[dict[str, Any]]]]
]  # each with what `rollout` measured, as it comes


def in_this_process(threads: int | None = None) -> Engine:
    """Plays the blocks one after the other.

    Args:
        threads: as World's.
    """

    def play(blocks):
        world = None
        for block in blocks:
            if world is None or world.scenario is not block.scenario:
                world = World(block.scenario, threads)
            yield block, rollout(block.policy, world, block.seeds)

    return play
