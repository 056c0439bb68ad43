"""Pictures of every scenario and of every policy's choice, for the site: frames of the environment itself.

python docs/pictures.py FOLDER    also makes the pictures of README, index, targets and, with chromium, of pages
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory

import numpy as np
from PIL import Image

from wsn_env import MultiEnv, Scenario, View, World, evaluate, make_policy
from wsn_env.compiled import draws
from wsn_env.envs.registration import IDS
from wsn_env.envs.rendering.camera import Camera
from wsn_env.envs.rendering.palette import BLUE, FLASH, FULL, GREEN, INK, ORANGE, PURPLE, SENSED, SKY, VERMILION, YELLOW
from wsn_env.envs.rendering.plan import SIZE
from wsn_env.reports.pages.evaluation_page import write_report
from wsn_env.reports.pages.replay_page import replay
from wsn_env.reports.pictures import write_picture
from wsn_env.reports.plots import draw_comparison

SEED, PERIODS = 7, 25
POLICIES = (  # where a policy is at home
    *((name, "PreDC-v0") for name in "pre_dc centroid static_cluster nearest3 adaptive greedy random".split()),
    *((name, "PreDC-v0") for name in ("planner", "mcts", "ppo")),
    *((name, "Rssi-v0") for name in ("informed3", "adaptive_informed")),
    *((name, "Binary-v0") for name in ("boundary",)),
    *((name, "Underwater-v0") for name in ("strongest_signal",)),
    *((name, "Lifetime-v0") for name in ("budget",)),
    *((name, "Ble-v0") for name in ("all", "strongest", "quadrants", "every")),
)
HOME = {"Binary-v0": "boundary", "Anchors-v0": "nearest2", "Underwater-v0": "strongest_signal", "Ble-v0": "informed3"}


def frames(name: str, policy: str, seed: int, periods: int, size: int = SIZE) -> Iterator[np.ndarray]:
    """A frame after every period of an episode."""
    scenario = Scenario.named(name)
    world, chooser, camera = World(scenario), make_policy(policy, scenario), Camera(scenario, frame_px=size)
    state, outcome = world.restart(world.allocate(1), [True], [draws.key_of_seed(seed)])
    camera.begin(state, outcome, [True])
    for _ in range(periods):
        state, outcome = world.step(state, chooser.act(View.of(state)))
        camera.add(state, outcome)
        yield camera.frames(state)[0]


def draw(name: str, policy: str, path: Path) -> None:
    """A frame of an episode under a policy, after PERIODS periods."""
    *_, last = frames(name, policy, SEED, PERIODS)
    Image.fromarray(last).save(path)


def film(path: Path, policies: Sequence[str] = ("pre_dc", "ppo"), seed: int = 3, periods: int = 60) -> None:
    """An animated GIF of an episode under policies side by side."""
    colours = Image.new("P", (1, 1))
    colours.putpalette(palette())
    together = zip(*(frames("PreDC-v0", policy, seed, periods, size=400) for policy in policies))
    pictures = [Image.fromarray(np.hstack(pair)).quantize(palette=colours, dither=0) for pair in together]
    pictures[0].save(path, save_all=True, append_images=pictures[1:], duration=120, loop=0)


def palette() -> list[int]:
    """The colours of frames, each in steps towards white, so that none is lost to those that cover more."""
    inks = (INK, BLUE, VERMILION, ORANGE, GREEN, SKY, PURPLE)
    steps = np.linspace(0, 1, 8)[:, None, None]
    blended = np.array(inks) * (1 - steps) + 255 * steps
    return [*blended.reshape(-1).astype(int).tolist(), *np.ravel([FULL, FLASH, YELLOW, *SENSED]).tolist()]


def draw_all(folder: Path) -> None:
    """scenario_NAME.png and policy_NAME.png; those that are there stay."""
    folder.mkdir(parents=True, exist_ok=True)
    wanted = {f"scenario_{name}": (name, HOME.get(name, "pre_dc")) for name in IDS}
    wanted |= {f"policy_{policy}": (name, policy) for policy, name in POLICIES}
    for stem, (name, policy) in wanted.items():
        path = folder / f"{stem}.png"
        if not path.exists():
            draw(name, policy, path)


def several_targets(path: Path, targets: int = 3, seed: int = 2, periods: int = 40) -> None:
    """A frame of a field with several targets."""
    env = MultiEnv("PreDC-v0", targets=targets, render_mode="rgb_array")
    policy = make_policy("nearest3", env.scenario)
    env.reset(seed=seed)
    for _ in range(periods):
        env.step(policy.act(env.view))
    Image.fromarray(env.render()).save(path)


def compare(path: Path, episodes: int = 1000) -> None:
    """The landing page's picture of error against energy."""
    rules = "greedy adaptive pre_dc strongest centroid static_cluster".split()
    evaluation = evaluate(["ppo", *rules, *(f"nearest{size}" for size in range(7))], "PreDC-v0", 4.0, episodes)
    write_picture(path, draw_comparison(evaluation, 4.0, emphasis="ppo"))


def photograph(page: str, path: Path, width: int, height: int) -> None:
    """A picture of a page as chromium shows it."""
    flags = f"--headless=new --no-sandbox --disable-gpu --hide-scrollbars --window-size={width},{height}".split()
    subprocess.run(["chromium", *flags, f"--screenshot={path}", page], check=True, capture_output=True)


def photograph_pages(folder: Path) -> None:
    """replay.png and report.png."""
    with TemporaryDirectory() as name:
        made = Path(name)
        scenario = Scenario.named("PreDC-v0")
        names = "ppo pre_dc nearest1 nearest2 nearest4 greedy adaptive".split()
        policies = {name: make_policy(name, scenario) for name in names}
        replay({name: policies[name] for name in ("pre_dc", "ppo")}, scenario, 3, made / "replay.html")
        photograph(f"{(made / 'replay.html').as_uri()}#60", folder / "replay.png", 1200, 820)
        write_report(made, evaluate(policies, scenario, [1.0, 4.0, 16.0]), policies)
        photograph((made / "report.html").as_uri(), folder / "report.png", 1000, 1900)


if __name__ == "__main__":
    draw_all(Path(sys.argv[1]))
    film(Path(sys.argv[1]) / "episode.gif")
    compare(Path(sys.argv[1]) / "comparison.png")
    several_targets(Path(sys.argv[1]) / "targets.png")
    if which("chromium"):
        photograph_pages(Path(sys.argv[1]).absolute())
