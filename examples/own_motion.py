"""A motion of your own: a target that patrols a square, corner by corner, and starts anywhere on it.

python examples/own_motion.py
wsn evaluate --policies greedy nearest2 --set motion=examples/own_motion.py:Patrol,speed_ms=1.5
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

import wsn_env
from wsn_env.compiled import draws
from wsn_env.models import Motion, quantity


@dataclass(frozen=True)
class Patrol(Motion):
    """Round a square about the middle of the field at a constant speed."""

    fitting_q: ClassVar[float] = 0.4  # m/s^2, the filter's process noise: corners turn the velocity at once

    speed_ms: float = quantity(1.0, "speed", above=0)
    square_m: float = quantity(50.0, "side of the square", above=0)

    def check(self, scenario):
        """The square must fit."""
        if self.square_m > scenario.field.side_m:
            raise wsn_env.ScenarioError(f"Patrol.square_m = {self.square_m}: must be at most {scenario.field.side_m} m")

    @staticmethod
    def draw(m, stream, course, track):
        low_x, low_y = 0.5 * (course.side_m - m.square_m), 0.5 * (course.depth_m - m.square_m)
        start = 4.0 * m.square_m * draws.uniform(stream, 0)
        for k in range(len(track)):
            way = (start + m.speed_ms * course.period_s * k) % (4.0 * m.square_m)
            side, along = int(way // m.square_m), way % m.square_m
            x = np.array((along, m.square_m, m.square_m - along, 0.0))[side]
            y = np.array((0.0, along, m.square_m, m.square_m - along))[side]
            track[k, 0], track[k, 2] = low_x + x, low_y + y
            track[k, 1] = m.speed_ms * np.array((1.0, 0.0, -1.0, 0.0))[side]
            track[k, 3] = m.speed_ms * np.array((0.0, 1.0, 0.0, -1.0))[side]


if __name__ == "__main__":
    scenario = wsn_env.Scenario.named("PreDC-v0", motion=Patrol(speed_ms=1.2), particles=1000)
    evaluation = wsn_env.evaluate(["pre_dc", "greedy", "nearest2"], scenario, episodes=10)
    for name in evaluation.policies:
        mean = evaluation.values(name, evaluation.lams[0], "rms_m").mean()
        print(f"{name}: RMS {mean:.2f} m")
