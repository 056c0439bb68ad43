"""Pictures of every scenario and of every policy's choice, for the site: frames of the environment itself.

python docs/pictures.py FOLDER
"""

from __future__ import annotations

import sys
from pathlib import Path

from PIL import Image

from wsn_env import Scenario, View, World, draws, make_policy
from wsn_env.registration import IDS
from wsn_env.rendering.camera import Camera

SEED, PERIODS = 7, 25
POLICIES = (  # where a policy is at home
    *((name, "PreDC-v0") for name in "pre_dc centroid static_cluster nearest3 adaptive greedy ppo random".split()),
    *((name, "Rssi-v0") for name in ("informed3",)),
    *((name, "Binary-v0") for name in ("boundary",)),
    *((name, "Underwater-v0") for name in ("strongest_signal",)),
    *((name, "Ble-v0") for name in ("all", "strongest", "quadrants", "every")),
)
HOME = {"Binary-v0": "boundary", "Anchors-v0": "nearest2", "Underwater-v0": "strongest_signal", "Ble-v0": "informed3"}


def draw(name: str, policy: str, path: Path) -> None:
    """A frame of an episode under a policy, after PERIODS periods."""
    scenario = Scenario.named(name)
    world, chooser, camera = World(scenario), make_policy(policy, scenario), Camera(scenario)
    state, outcome = world.restart(world.allocate(1), [True], [draws.key_of_seed(SEED)])
    camera.begin(state, outcome, [True])
    for _ in range(PERIODS):
        state, outcome = world.step(state, chooser.act(View.of(state)))
        camera.add(state, outcome)
    Image.fromarray(camera.frames(state)[0]).save(path)


def draw_all(folder: Path) -> None:
    """scenario_NAME.png and policy_NAME.png; those that are there stay."""
    folder.mkdir(parents=True, exist_ok=True)
    wanted = {f"scenario_{name}": (name, HOME.get(name, "pre_dc")) for name in IDS}
    wanted |= {f"policy_{policy}": (name, policy) for policy, name in POLICIES}
    for stem, (name, policy) in wanted.items():
        path = folder / f"{stem}.png"
        if not path.exists():
            draw(name, policy, path)


if __name__ == "__main__":
    draw_all(Path(sys.argv[1]))
