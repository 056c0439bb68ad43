"""A sensor of your own: it measures the bearing of the target, an angle, with wrapped noise.

python examples/own_sensor.py
wsn evaluate --policies greedy nearest2 --set measurement=examples/own_sensor.py:Bearing,sd_deg=5
"""

import math
from dataclasses import dataclass

import gymnasium as gym

import wsn_env
from wsn_env.compiled import draws
from wsn_env.models import Line, Measurement, quantity

WHOLE = 2 * math.pi


@dataclass(frozen=True)
class Bearing(Measurement):
    """The direction from a node to the target, anticlockwise from the x axis, in -pi .. pi."""

    sd_deg: float = quantity(3.0, "sd of a bearing", above=0, at_most=60)
    near_m: float = quantity(0.5, "nearer than this a bearing tells no more of the position", above=0)

    def constants(self, scenario):
        return {"sd": math.radians(self.sd_deg), "near2": self.near_m**2}

    @staticmethod
    def sample(m, stream, node, x, y):
        noise, _ = draws.normal_pair(stream, node.number)
        angle = math.atan2(y - node.y, x - node.x) + m.sd * noise
        return angle - WHOLE * math.floor(angle / WHOLE + 0.5), 0.0

    @staticmethod
    def log_likelihood(m, value, second, node, x, y):
        off = value - math.atan2(y - node.y, x - node.x)
        off -= WHOLE * math.floor(off / WHOLE + 0.5)
        return -0.5 * (off / m.sd) ** 2

    @staticmethod
    def linearise(m, node, belief):
        dx, dy = belief.x - node.x, belief.y - node.y
        squared = max(dx * dx + dy * dy, m.near2)  # d angle = (dx dy' - dy dx') / d^2
        return (Line(math.atan2(dy, dx), -dy / squared, dx / squared, m.sd * m.sd),)

    @staticmethod
    def unwrap(m, value, about):
        return value - WHOLE * math.floor((value - about) / WHOLE + 0.5)


if __name__ == "__main__":
    env = gym.make("wsn_env/PreDC-v0", measurement=Bearing(sd_deg=3), particles=1000)
    env.reset(seed=1)
    infos = [env.step(env.action_space.sample())[4] for _ in range(100)]
    print("random clusters: RMS {episode_rms_m:.2f} m, reference {episode_reference_m:.2f} m".format(**infos[-1]))
    scenario = wsn_env.Scenario.named("PreDC-v0", measurement=Bearing(sd_deg=3), particles=1000)
    for row in wsn_env.evaluate(["greedy", "informed2"], scenario, episodes=3).rows:
        print(f"{row['policy']}: RMS {row['rms_m']:.2f} m, {row['energy_mj']:.3f} mJ a period")
