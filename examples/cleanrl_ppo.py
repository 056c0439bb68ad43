# /// script
# dependencies = ["wsn_env", "torch==2.13.0"]
# ///
"""PPO in a single file, after CleanRL's: nothing but torch between the native batch and the update.

python examples/cleanrl_ppo.py --steps 20000
"""

import gymnasium as gym
import torch
import tyro
from closing import ENV, FIELD, Example
from torch import nn
from torch.distributions import Categorical

from wsn_env.learning.training_reward import TrainingReward

GAMMA, LAMBDA, CLIP, EPOCHS, BATCH = 0.95, 0.9, 0.2, 10, 256


def mlp(inputs: int, outputs: int, gain: float) -> nn.Sequential:
    """Two tanh layers of 64."""
    layers = nn.Sequential(nn.Linear(inputs, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, outputs))
    for layer, own in zip(layers[::2], (2**0.5, 2**0.5, gain)):
        nn.init.orthogonal_(layer.weight, own)
        nn.init.zeros_(layer.bias)
    return layers


def main(steps: int = 20_000, rows: int = 64, rollout: int = 16, seed: int = 0) -> None:
    """Train, then play."""
    torch.manual_seed(seed)
    example = Example("CleanRL-style PPO")
    # Same-step: the observation after an episode's last step is the first of the next; the last is in final_obs.
    envs = TrainingReward(
        gym.make_vec(ENV, rows, vectorization_mode="vector_entry_point", autoreset_mode="SameStep", **FIELD)
    )
    inputs = envs.single_observation_space.shape[0]
    actor, critic = mlp(inputs, envs.single_action_space.n, gain=0.01), mlp(inputs, 1, gain=1.0)
    optimizer = torch.optim.Adam([*actor.parameters(), *critic.parameters()], lr=1e-3, eps=1e-5)
    seen, actions = torch.zeros(rollout, rows, inputs), torch.zeros(rollout, rows, dtype=torch.long)
    logprobs, rewards, ends, values, followed_by = torch.zeros(5, rollout, rows)
    now = torch.as_tensor(envs.reset(seed=seed)[0])
    updates = -(-steps // (rollout * rows))
    for _ in range(updates):
        with torch.no_grad():
            for t in range(rollout):
                policy = Categorical(logits=actor(now))
                seen[t], actions[t], values[t] = now, policy.sample(), critic(now)[:, 0]
                logprobs[t] = policy.log_prob(actions[t])
                observations, reward, _, truncated, info = envs.step(actions[t].numpy())
                rewards[t], ends[t], now = (
                    torch.as_tensor(reward),
                    torch.as_tensor(truncated),
                    torch.as_tensor(observations),
                )
                followed_by[t] = critic(now)[:, 0]
                for row in truncated.nonzero()[0]:  # cut off, not over: worth what would have followed
                    followed_by[t, row] = critic(torch.as_tensor(info["final_obs"][row]))[0]
            advantages, later = torch.zeros_like(rewards), 0.0
            for t in reversed(range(rollout)):
                later = rewards[t] + GAMMA * followed_by[t] - values[t] + GAMMA * LAMBDA * (1 - ends[t]) * later
                advantages[t] = later
        flat = [x.flatten(0, 1) for x in (seen, actions, logprobs, advantages, advantages + values)]
        for _ in range(EPOCHS):
            for batch in torch.randperm(rollout * rows).split(BATCH):
                saw, did, before, advantage, target = (x[batch] for x in flat)
                policy = Categorical(logits=actor(saw))
                ratio = (policy.log_prob(did) - before).exp()
                advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
                gain = torch.min(ratio * advantage, ratio.clamp(1 - CLIP, 1 + CLIP) * advantage).mean()
                miss = (critic(saw)[:, 0] - target).square().mean()
                loss = 0.5 * miss - gain - 1e-3 * policy.entropy().mean()
                optimizer.zero_grad()
                loss.backward()
                nn.utils.clip_grad_norm_([*actor.parameters(), *critic.parameters()], 0.5)
                optimizer.step()
    with torch.no_grad():
        example.close(lambda seen: actor(torch.as_tensor(seen)).argmax(1).numpy(), updates * rollout * rows)


if __name__ == "__main__":
    tyro.cli(main)
