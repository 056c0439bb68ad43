"""A step of the single environment costs the same, within a factor of 1.5, from 225 to 1,000,000 nodes: at the same
node density and in a field of the same size, with a cluster of a head and 3 members.

    python -m benchmarks.nodes [--rounds N] [--short] [--json FILE]

Without the search for lost targets, which wakes every node by definition. Also the search for the 12 nearest nodes
alone, and a reset, which draws and sorts every node.
"""

import math
from collections.abc import Callable

import gymnasium as gym
import numpy as np
from rich.console import Console

from benchmarks.race import Claim, Options, Plot, Result, Table, Times, figure, interleave, main
from benchmarks.stopwatch import Stopwatch
from benchmarks.vector import FIXED, ID, MENU_ENTRY
from wsn_env.compiled.kernels import lean_kernel
from wsn_env.envs.interface import Settings
from wsn_env.models.state import Network, network_at
from wsn_env.scenario import Scenario
from wsn_env.simulation.geometry import nearest, nearest_candidates
from wsn_env.simulation.world import World

NODES, SHORT_NODES = (225, 1000, 10_000, 100_000, 1_000_000), (225, 1000, 10_000)
SMALLEST = NODES[0]
DENSITY, SIDE = "same density", "same side"
AT_MOST = 1.5
EPISODES = 3  # in a turn
POINTS = 500  # asked for their nearest nodes in a turn
STEP, RESET, NEAREST, COMPILED = "step", "reset", f"{Settings.candidates} nearest", "without the call"


def measure(options: Options, console: Console) -> Result:
    """Both kinds of growth."""
    result = Result(
        name="nodes",
        title="Cost against nodes",
        text=f"One environment of {ID} (P = {Scenario.named(ID).tracking.particles}), one thread, search=False, moving"
        " the head to the nearest node with 3 further members. Ratios are over 225 nodes.",
        packages=["gymnasium"],
    )
    sizes = SHORT_NODES if options.short else NODES
    lines: dict[str, list] = {}
    for growth in (DENSITY, SIDE):
        console.print(f"environments of {sizes[0]} to {sizes[-1]:,} nodes, {growth}", style="dim")
        times = race(growth, sizes, options)
        result.tables.append(table(growth, sizes, times))
        what = f"gym.make: a step's slowest over its fastest, {sizes[0]} to {sizes[-1]:,} nodes"
        result.claims.append(Claim(what, AT_MOST, flatness(times, sizes), at_most=True, case=growth))
        result.figures[growth] = times.seconds
        for what in (STEP, NEAREST, COMPILED):
            lines[f"{what}, {growth}"] = [(nodes, 1e6 * times.median(_name(what, nodes))) for nodes in sizes]
    result.plots.append(Plot("nodes", "Cost against nodes (P = 5000, one thread)", "nodes S", "us", lines))
    return result


def scenario_of(nodes: int, growth: str) -> dict:
    """Overrides: `nodes` at the density of the scenario, or in its field."""
    side_m = Scenario.named(ID).field.side_m
    return FIXED | {"nodes": nodes, "side_m": side_m * math.sqrt(nodes / SMALLEST) if growth == DENSITY else side_m}


def race(growth: str, sizes: tuple[int, ...], options: Options) -> Times:
    """Seconds by f"{what}, {nodes}"."""
    watch = Stopwatch()
    steps, others = {}, {}
    for nodes in sizes:
        env = gym.make(ID, search=False, **scenario_of(nodes, growth))
        env.reset(seed=0)
        steps[_name(STEP, nodes)] = episodes(env, watch)
        others[_name(RESET, nodes)] = env.reset
        others[_name(NEAREST, nodes)], others[_name(COMPILED, nodes)] = searches(growth, nodes)
    units = {name: EPISODES * env.unwrapped.scenario.periods for name in steps}
    units |= {name: POINTS for name in others if not name.startswith(RESET)}
    found = interleave(steps, options, units, clock=watch, turn_s=0.0)
    few = Options(min(options.rounds, 5), options.short)
    return Times(found.seconds | interleave(others, few, units, turn_s=0.004).seconds)


def episodes(env: gym.Env, watch: Stopwatch) -> Callable[[], None]:
    """A call that steps through some episodes, each a new one; the watch stands still in resets."""

    def call():
        for _ in range(EPISODES):
            env.reset()
            truncated = False
            with watch:
                while not truncated:
                    truncated = env.step(MENU_ENTRY)[3]

    return call


def searches(growth: str, nodes: int) -> tuple[Callable[[], None], Callable[[], None]]:
    """Calls that find the nodes nearest to some random points, one after the other: each called from Python, and all in
    a compiled loop, as within a step."""
    network = network_of(growth, nodes)
    side_m = scenario_of(nodes, growth)["side_m"]
    points = np.random.default_rng(0).uniform(0.0, side_m, (POINTS, 1, 2))

    found = np.empty(Settings.candidates, np.int64), np.empty(Settings.candidates)

    def call():
        for point in points:
            nearest(network, point, Settings.candidates)

    return call, lambda: _search(network.handle, points[:, 0], *found)


@lean_kernel
def _search(network_handle, points, nodes, distances):
    network = network_at(network_handle)
    for i in range(len(points)):
        nearest_candidates(network, 0, points[i, 0], points[i, 1], nodes, distances)


def network_of(growth: str, nodes: int) -> Network:
    """A row's, every node alive."""
    return World(Scenario.named(ID, **scenario_of(nodes, growth)), threads=1).reset([1]).network


def flatness(times: Times, sizes: tuple[int, ...]) -> float:
    """How many times as long as at the fastest size a step takes at the slowest."""
    names = sorted((_name(STEP, nodes) for nodes in sizes), key=times.median)
    return times.ratio(names[-1], names[0])


def table(growth: str, sizes: tuple[int, ...], times: Times) -> Table:
    """A line a size."""
    lines = []
    for nodes in sizes:
        line = [f"{nodes:,}"]
        for what in (STEP, NEAREST, COMPILED):
            name, base = _name(what, nodes), _name(what, SMALLEST)
            low, high = times.spread(name, base)
            ratio = f"{figure(times.ratio(name, base))} ({figure(low)}-{figure(high)})"
            line += [figure(1e6 * times.median(name)), ratio]
        lines.append([*line, f"{1e3 * times.median(_name(RESET, nodes)):.3g}"])
    columns = ["nodes", *(cell for what in (STEP, NEAREST, COMPILED) for cell in (f"{what}, us", "ratio"))]
    columns.append(f"{RESET}, ms")
    return Table(f"{growth.capitalize()} (quartiles)", columns, lines)


def _name(what: str, nodes: int) -> str:
    return f"{what}, {nodes}"


if __name__ == "__main__":
    main(measure, __doc__)
