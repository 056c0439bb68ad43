# /// script
# dependencies = ["wsn_env", "torch==2.13.0", "skrl==2.1.1"]
# ///
"""skrl's PPO: takes the native batch as it is.

python examples/skrl_ppo.py --steps 20000
"""

import gymnasium as gym
import torch
import tyro
from closing import ENV, FIELD, Example
from skrl.agents.torch.ppo import PPO, PPO_CFG
from skrl.envs.wrappers.torch import wrap_env
from skrl.memories.torch import RandomMemory
from skrl.trainers.torch import SequentialTrainer
from skrl.utils import set_seed
from skrl.utils.model_instantiators.torch import categorical_model, deterministic_model

from wsn_env.learning.training_reward import TrainingReward

LAYERS = [{"name": "net", "input": "OBSERVATIONS", "layers": [64, 64], "activations": "tanh"}]


def main(steps: int = 20_000, rows: int = 64, rollout: int = 16, seed: int = 0) -> None:
    """Train, then play."""
    set_seed(seed)
    example = Example("skrl PPO")
    native = gym.make_vec(ENV, rows, vectorization_mode="vector_entry_point", autoreset_mode="SameStep", **FIELD)
    native.reset(seed=seed)  # skrl's own reset has no seed: it goes on with these generators
    envs = wrap_env(TrainingReward(native))
    spaces = dict(observation_space=envs.observation_space, action_space=envs.action_space, device="cpu")
    models = {
        "policy": categorical_model(**spaces, network=LAYERS, output="ACTIONS"),
        "value": deterministic_model(**spaces, network=LAYERS, output="ONE"),
    }
    cfg = PPO_CFG(rollouts=rollout, learning_epochs=10, mini_batches=4, discount_factor=0.95, gae_lambda=0.9)
    cfg.value_clip, cfg.value_loss_scale, cfg.entropy_loss_scale = 0.0, 0.5, 1e-3
    cfg.time_limit_bootstrap = True  # episodes are cut off, never over
    cfg.experiment.write_interval = cfg.experiment.checkpoint_interval = 0
    agent = PPO(models=models, memory=RandomMemory(memory_size=rollout, num_envs=rows), cfg=cfg, **spaces)
    updates = -(-steps // (rollout * rows))
    SequentialTrainer(env=envs, agents=agent, cfg={"timesteps": updates * rollout, "headless": True}).train()

    def act(observations):
        with torch.no_grad():
            _, outputs = models["policy"].act({"observations": torch.as_tensor(observations)}, role="policy")
        return outputs["net_output"].argmax(1).numpy()

    example.close(act, updates * rollout * rows)


if __name__ == "__main__":
    tyro.cli(main)
