# /// script
# dependencies = ["wsn_env", "torch==2.13.0", "mo-gymnasium==1.3.2", "morl-baselines==1.3.0"]
# ///
"""MORL-Baselines' Envelope Q-learning: one network for every weight of (error, energy), played at that of lam.

python examples/morl_baselines_envelope.py --steps 20000
"""

import mo_gymnasium as mo
import numpy as np
import torch
import tyro
from closing import ENV, FIELD, Example
from morl_baselines.multi_policy.envelope.envelope import Envelope

WEIGHT = np.array([1.0, FIELD["lam"]], np.float32) / (1.0 + FIELD["lam"])  # of a metre and of a millijoule


def main(steps: int = 20_000, seed: int = 0) -> None:
    """Train, then play."""
    torch.manual_seed(seed)
    np.random.seed(seed)  # the replay buffer draws with it
    example = Example("MORL-Baselines Envelope")
    env = mo.make(ENV, **FIELD | {"reward": "vector"})
    env.action_space.seed(seed)
    env.reset(seed=seed)
    agent = Envelope(
        env,
        learning_rate=1e-3,
        initial_epsilon=1.0,
        final_epsilon=0.05,
        epsilon_decay_steps=steps // 2,
        net_arch=[64, 64],
        batch_size=64,
        num_sample_w=2,
        buffer_size=steps,
        gamma=0.9,
        per=False,
        log=False,
        seed=seed,
        device="cpu",
    )
    agent.train(steps, reset_num_timesteps=False)

    @torch.no_grad()
    def act(observations):
        weights = torch.as_tensor(WEIGHT).expand(len(observations), -1)
        values = agent.q_net(torch.as_tensor(observations), weights)  # (B, actions, objectives)
        return (values @ torch.as_tensor(WEIGHT)).argmax(1).numpy()

    example.close(act, steps)


if __name__ == "__main__":
    tyro.cli(main)
