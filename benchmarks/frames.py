"""Frames of 600 x 600 pixels: 500 a second, beside Pillow's shapes with and without smooth edges.

    python -m benchmarks.frames [--rounds N] [--short] [--json FILE]

Pillow, whose edges are not smooth, draws the nodes, the particles, the cluster and the two tails only: no ranges, no
ellipse, no words. Smooth, it draws twice as large and reduces.
"""

import numpy as np
from PIL import Image, ImageDraw
from rich.console import Console

from benchmarks.race import Claim, Options, Result, Table, figure, interleave, main
from wsn_env import Scenario, View, World, make_policy
from wsn_env.compiled import draws
from wsn_env.envs.rendering.camera import Camera
from wsn_env.envs.rendering.palette import BLUE, FULL, GREEN, INK, ORANGE, PAPER, SKY, VERMILION
from wsn_env.envs.rendering.plan import SIZE

PERIODS = 60  # of the tails
AT_LEAST_FPS = 500.0


def by_pillow(state, scenario, estimates, enlarged: int) -> np.ndarray:
    """A frame's main shapes, reduced from a picture so many times as large."""
    size = enlarged * SIZE
    scale = 0.8 * size / max(scenario.field.room_m)
    image = Image.new("RGB", (size, size), PAPER)
    draw = ImageDraw.Draw(image)

    def pixels(points) -> list[float]:
        return (np.array((0.1 * size, 0.9 * size)) + np.asarray(points) * (scale, -scale)).ravel().tolist()

    def discs(points, radius, colour):
        flat = pixels(points)
        for x, y in zip(flat[::2], flat[1::2]):
            draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=colour)

    nodes = state.network.positions[0]
    head, members = state.network.head[0], state.network.members[0, : state.network.n_members[0]]
    discs(nodes, 3 * enlarged, FULL)
    draw.point(pixels(state.belief.particles[0, ::2].T), fill=SKY)
    for node in state.reports.node[0, : state.reports.count[0]]:
        draw.line(pixels(nodes[[node, head]]), fill=ORANGE, width=2 * enlarged)
    discs(nodes[members], 5 * enlarged, BLUE)
    discs(nodes[[head]], 8 * enlarged, VERMILION)
    draw.line(pixels(state.track[0, : state.row["period"][0] + 1, ::2]), fill=GREEN, width=2 * enlarged)
    draw.line(pixels(estimates), fill=INK, width=enlarged)
    return np.asarray(image if enlarged == 1 else image.reduce(enlarged))


def measure(options: Options, console: Console) -> Result:
    """Play an episode, check that all draw it, race."""
    scenario = Scenario.named("PreDC-v0")
    world, policy, camera = World(scenario, threads=1), make_policy("pre_dc", scenario), Camera(scenario)
    state, outcome = world.restart(world.allocate(1), [True], [draws.key_of_seed(0)])
    camera.begin(state, outcome, [True])
    estimates = []
    for _ in range(PERIODS):
        state, outcome = world.step(state, policy.act(View.of(state)))
        camera.add(state, outcome)
        estimates.append(outcome.estimate_m[0])
    console.print(f"frames, period {PERIODS} of {scenario.name}", style="dim")
    calls = {
        "wsn_env": lambda: camera.frames(state)[0],
        "Pillow, jagged": lambda: by_pillow(state, scenario, estimates, 1),
        "Pillow, smooth": lambda: by_pillow(state, scenario, estimates, 2),
    }
    check_same_colours(calls)
    times = interleave(calls, options)
    return Result(
        name="frames",
        title="Frames",
        text=f"A frame of {SIZE} x {SIZE} pixels of {scenario.name} in its period {PERIODS}: "
        f"{scenario.field.nodes} nodes, {scenario.tracking.particles:,} particles, two tails. "
        "Pillow draws the main shapes only, without ranges, ellipse and words.",
        claims=[
            Claim("frames a second", AT_LEAST_FPS, 1 / times.median("wsn_env"), unit="fps"),
            Claim("the same over Pillow, smooth", 2.0, times.ratio("Pillow, smooth", "wsn_env")),
        ],
        tables=[
            Table(
                "Time on one core",
                ["painter", "ms", "frames/s"],
                [[name, figure(1000 * times.median(name)), figure(1 / times.median(name))] for name in calls],
            )
        ],
        packages=["numpy", "pillow"],
    )


def check_same_colours(calls) -> None:
    """Raise unless every painter has drawn awake nodes, head and track."""
    for name, call in calls.items():
        picture = call()
        for colour in (BLUE, VERMILION, GREEN):
            if not (picture == colour).all(axis=2).any():
                raise SystemExit(f"{name} lacks the colour {colour}")


if __name__ == "__main__":
    main(measure, __doc__)
