# /// script
# dependencies = ["wsn_env[ray]", "torch==2.13.0", "ray==2.60.0"]
# ///
"""RLlib's PPO (new API stack): every env runner steps a native batch.

    python examples/rllib_ppo.py --steps 20000
    python examples/rllib_ppo.py --runners 2 --seed None

`NativeRunner` takes the batch array by array. RLlib's own runner works with it, too, and is slower.
"""

import torch
import tyro
from closing import ENV, FIELD, Example
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig

from wsn_env.learning.native_runner import NativeRunner


def main(steps: int = 20_000, rows: int = 64, runners: int = 0, seed: int | None = 0) -> None:
    """Train, then play."""
    example = Example("RLlib PPO")
    rollout = 16 * rows * max(runners, 1)
    config = (
        PPOConfig()
        # module:id, so that remote workers import it
        .environment(f"wsn_env:{ENV}", env_config=FIELD | {"autoreset_mode": "Disabled"})
        .env_runners(
            env_runner_cls=NativeRunner,
            num_env_runners=runners,
            num_envs_per_env_runner=rows,
            gym_env_vectorize_mode="vector_entry_point",
            rollout_fragment_length=16,
        )
        .training(
            train_batch_size_per_learner=rollout,
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
        trained = int(algorithm.train()["num_env_steps_sampled_lifetime"])
    module = algorithm.get_module()

    def act(observations):
        with torch.no_grad():
            outputs = module.forward_inference({"obs": torch.as_tensor(observations)})
        return outputs["action_dist_inputs"].argmax(1).numpy()

    example.close(act, trained)


if __name__ == "__main__":
    tyro.cli(main)
