# /// script
# dependencies = ["wsn_env[ray,multi]", "torch==2.13.0", "pettingzoo==1.27.0", "ray==2.60.0"]
# ///
"""Several targets: PettingZoo's environment in RLlib's multi-agent PPO (new API stack). All agents share one policy.

    python examples/rllib_multi_agent.py --steps 20000

An agent observes what the single agent of a field with one target does, so the policy is scored there as it is.
"""

import torch
import tyro
from closing import FIELD, Example
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig
from ray.rllib.env.wrappers.pettingzoo_env import ParallelPettingZooEnv
from ray.tune.registry import register_env

import wsn_env

POLICY = "shared"


def make(config: dict) -> ParallelPettingZooEnv:
    """A field with an agent for each target."""
    return ParallelPettingZooEnv(wsn_env.parallel_env("Multi-v0", rewards="own", **FIELD, **config))


def main(steps: int = 20_000, fields: int = 20, targets: int = 3, seed: int = 0) -> None:
    """Train, then play. `steps` counts those of every target."""
    example = Example("RLlib multi-agent PPO")
    register_env("several_targets", make)
    config = (
        PPOConfig()
        .environment("several_targets", env_config={"targets": targets})
        .multi_agent(policies={POLICY}, policy_mapping_fn=lambda agent, episode, **_: POLICY)
        .env_runners(num_env_runners=0, num_envs_per_env_runner=fields, rollout_fragment_length=16)
        .training(
            train_batch_size_per_learner=16 * fields,  # counts time steps of fields, each with all targets
            minibatch_size=256,
            num_epochs=10,
            lr=1e-3,
            gamma=0.95,
            lambda_=0.9,
            vf_clip_param=float("inf"),
            vf_loss_coeff=0.5,
            grad_clip=0.5,
            use_kl_loss=False,
        )
        .rl_module(model_config=DefaultModelConfig(fcnet_hiddens=[64, 64], vf_share_layers=False))
        .debugging(seed=seed, log_level="ERROR")
    )
    algorithm = config.build_algo()
    trained = 0
    while trained < steps:
        trained = targets * int(algorithm.train()["num_env_steps_sampled_lifetime"])
    module = algorithm.get_module(POLICY)

    def act(observations):
        with torch.no_grad():
            outputs = module.forward_inference({"obs": torch.as_tensor(observations)})
        return outputs["action_dist_inputs"].argmax(1).numpy()

    example.close(act, trained)


if __name__ == "__main__":
    tyro.cli(main)
