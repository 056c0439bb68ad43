# /// script
# dependencies = ["wsn_env", "torch==2.13.0", "torchrl==0.14.1"]
# ///
"""TorchRL's PPO: `GymWrapper` takes the native batch as it is.

python examples/torchrl_ppo.py --steps 20000
"""

import gymnasium as gym
import torch
import tyro
from closing import ENV, FIELD, Example
from tensordict.nn import TensorDictModule
from torch.distributions import Categorical
from torchrl.collectors import Collector
from torchrl.envs import GymWrapper
from torchrl.modules import MLP, ProbabilisticActor, ValueOperator
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value import GAE


def main(steps: int = 20_000, rows: int = 64, rollout: int = 16, seed: int = 0) -> None:
    """Train, then play."""
    torch.manual_seed(seed)
    example = Example("TorchRL PPO")
    native = gym.make_vec(ENV, rows, vectorization_mode="vector_entry_point", autoreset_mode="SameStep", **FIELD)
    envs = GymWrapper(native, categorical_action_encoding=True)
    envs.set_seed(seed)
    inputs, choices = native.single_observation_space.shape[0], native.single_action_space.n
    network = MLP(in_features=inputs, out_features=choices, num_cells=[64, 64], activation_class=torch.nn.Tanh)
    logits = TensorDictModule(network, in_keys=["observation"], out_keys=["logits"])
    actor = ProbabilisticActor(logits, in_keys=["logits"], distribution_class=Categorical, return_log_prob=True)
    critic = ValueOperator(MLP(in_features=inputs, out_features=1, num_cells=[64, 64], activation_class=torch.nn.Tanh))
    advantage = GAE(gamma=0.95, lmbda=0.9, value_network=critic)
    loss = ClipPPOLoss(actor, critic, entropy_coeff=1e-3, critic_coeff=0.5, normalize_advantage=True)
    optimizer = torch.optim.Adam(loss.parameters(), lr=1e-3)
    collector = Collector(
        envs, actor, frames_per_batch=rollout * rows, total_frames=-(-steps // (rollout * rows)) * rollout * rows
    )
    trained = 0
    for data in collector:
        trained += data.numel()
        with torch.no_grad():
            advantage(data)
        flat = data.flatten()
        for _ in range(10):
            for batch in torch.randperm(len(flat)).split(256):
                losses = loss(flat[batch])
                total = losses["loss_objective"] + losses["loss_critic"] + losses["loss_entropy"]
                optimizer.zero_grad()
                total.backward()
                torch.nn.utils.clip_grad_norm_(loss.parameters(), 0.5)
                optimizer.step()
    with torch.no_grad():
        example.close(lambda observations: network(torch.as_tensor(observations)).argmax(1).numpy(), trained)


if __name__ == "__main__":
    tyro.cli(main)
