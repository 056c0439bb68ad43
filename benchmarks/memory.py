"""Memory of a row: at most 1.5 (24 P + 64 S) bytes when stepping with donate=True, both as the arrays' sizes and as
what a process grows by, beyond the scratch of a thread.

    python -m benchmarks.memory [--short] [--json FILE]

The growth is that of the resident memory at its peak, in a process of its own, from before `World.reset` of 256 rows to
the end of some steps; pages that nothing has touched do not count, so that it may be less than the arrays.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
from rich.console import Console

from benchmarks.race import Claim, Options, Result, Table, figure, main
from benchmarks.vector import FIXED, ID
from wsn_env.filters.kernels import make_scratch
from wsn_env.models.state import Cluster, State
from wsn_env.scenario import Scenario
from wsn_env.simulation.world import World

SIZES = ((5000, 225), (500, 225), (5000, 10_000))  # particles, nodes
ROWS, SHORT_ROWS = 256, 32
LARGE = ("belief", "track", "residual_j", "ledger", "network", "reports")  # parts with a column of their own
STEPS = 5
AT_MOST = 1.5  # times a particle's 24 bytes and a node's 64
STATUS, CLEAR = Path("/proc/self/status"), Path("/proc/self/clear_refs")
FRESH = {"MALLOC_MMAP_THRESHOLD_": "16384"}  # arrays get pages of their own, not what is left of others
HERE = Path(__file__).resolve().parents[1]


def measure(options: Options, console: Console) -> Result:
    """Count, then watch processes grow."""
    rows = SHORT_ROWS if options.short else ROWS
    result = Result(
        name="memory",
        title="Memory of a row",
        text=f"Bytes a row of {ID}: the state's arrays, of which the track (101 periods of 4 numbers) grows with"
        f" neither particles nor nodes; and the growth of a process that steps {rows} rows with donate=True, less the"
        f" scratch of its one thread, {figure(scratch_bytes(10**6) / 1e6)} P bytes.",
    )
    lines = []
    for particles, nodes in SIZES[: 1 if options.short else None]:
        console.print(f"memory, {particles} particles, {nodes} nodes", style="dim")
        size = f"P = {particles:,}, S = {nodes:,}"
        basis = 24 * particles + 64 * nodes
        counted = bytes_by_part(_world(particles, nodes).allocate(1))
        total = sum(counted.values())
        grown, why = measure_growth(particles, nodes, rows)
        resident = None if grown is None else (grown - scratch_bytes(particles)) / rows
        result.claims += [
            Claim(
                "memory of a row over 24 P + 64 S bytes",
                AT_MOST,
                value and value / basis,
                at_most=True,
                why=why,
                case=f"{name}, {size}",
            )
            for name, value in (("arrays", total), ("resident", resident))
        ]
        large = {name: value for name, value in counted.items() if name in LARGE}
        cells = [f"{value:,}" for value in (*large.values(), total - sum(large.values()), total)]
        lines.append([f"{particles:,}", f"{nodes:,}", *cells, "" if resident is None else f"{resident:,.0f}"])
        result.figures[size] = {"rows": rows, "arrays_bytes": counted, "growth_bytes": grown, "basis_bytes": basis}
    columns = ["P", "S", *large, "others", "arrays", "resident"]
    result.tables.append(Table("Bytes a row", columns, lines))
    return result


def bytes_by_part(state: State) -> dict[str, int]:
    """Bytes a row of a state's arrays, by its parts."""
    parts = dict.fromkeys(("belief", "track"), 0)
    for name, array in state.leaves():
        part = name.partition(".")[0]
        parts[part] = parts.get(part, 0) + array.nbytes // state.rows
    return parts


def scratch_bytes(particles: int) -> int:
    """Of a thread's filter."""
    return sum(array.nbytes for array in make_scratch.py_func(particles))


def measure_growth(particles: int, nodes: int, rows: int) -> tuple[int | None, str]:
    """Bytes by which a process grows at its peak when it resets and steps; or None and why it cannot be told."""
    if not CLEAR.exists():
        return None, f"no {CLEAR}"
    program = f"from benchmarks.memory import print_growth; print_growth({particles}, {nodes}, {rows})"
    command, settings = [sys.executable, "-c", program], os.environ | FRESH
    child = subprocess.run(command, cwd=HERE, env=settings, capture_output=True, text=True, check=True)
    return json.loads(child.stdout.splitlines()[-1]), ""


def print_growth(particles: int, nodes: int, rows: int) -> None:
    """In the child: print the growth. Two rows run before, so that the code is loaded."""
    world = _world(particles, nodes)
    kept = [_run(world, 2)]  # not freed: what comes could settle in its place, unseen
    before = resident_bytes("VmRSS")
    CLEAR.write_text("5", encoding="utf-8")  # the peak begins anew
    kept.append(_run(world, rows))
    print(resident_bytes("VmHWM") - before)


def _world(particles: int, nodes: int) -> World:
    return World(Scenario.named(ID, particles=particles, nodes=nodes, **FIXED), threads=1)


def _run(world: World, rows: int) -> State:
    """Reset, then step clusters of four nodes."""
    state = world.reset(np.arange(1, rows + 1, dtype=np.uint64))
    for step in range(STEPS):
        heads = np.full(rows, step, np.int64)
        members = np.tile(np.arange(step + 1, step + 4, dtype=np.int32), (rows, 1))
        state, _ = world.step(state, Cluster(heads, members), donate=True)
    return state


def resident_bytes(name: str) -> int:
    """VmRSS, now; VmHWM, at its peak."""
    for line in STATUS.read_text(encoding="utf-8").splitlines():
        if line.startswith(f"{name}:"):
            return 1024 * int(line.split()[1])
    raise OSError(f"{STATUS} has no {name}")


if __name__ == "__main__":
    main(measure, __doc__)
