"""stable-baselines3 policies whose actor scores entries: the torch twin of `EntryNetwork`."""

from __future__ import annotations

from typing import Any, Literal

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.type_aliases import Schedule
from torch import nn

from wsn_env.learning.network import EntryNetwork, FlatNetwork, PolicyNetwork


class EntryActorCritic(nn.Module):
    """Actor: `EntryNetwork`. Critic: a flat network of the whole observation, two layers of tanh; it only serves
    training.

    Args:
        belief, entry: lengths of the observation's head and of each of its entries.
        observation: its whole length.
        outputs: 1: a logit for each entry (menu); 2: leading and being awake (subset).
        actor, critic: units of the two hidden layers.
    """

    def __init__(
        self,
        belief: int,
        entry: int,
        observation: int,
        outputs: int,
        actor: tuple[int, int],
        critic: tuple[int, int],
    ) -> None:
        super().__init__()
        self.sizes: tuple[int, int, int] = belief, entry, outputs
        self.belief: nn.Linear = nn.Linear(belief, actor[0])
        self.entry: nn.Linear = nn.Linear(entry, actor[0], bias=False)
        self.hidden: nn.Linear = nn.Linear(actor[0], actor[1])
        self.score: nn.Linear = nn.Linear(actor[1], outputs)
        layers = [nn.Linear(observation, critic[0]), nn.Tanh(), nn.Linear(critic[0], critic[1]), nn.Tanh()]
        self.critic: nn.Sequential = nn.Sequential(*layers, nn.Linear(critic[1], 1))
        for layer in self.modules():
            if isinstance(layer, nn.Linear):
                gain = 0.01 if layer is self.score else 1.0 if layer is self.critic[-1] else 2**0.5
                nn.init.orthogonal_(layer.weight, gain)
                if layer.bias is not None:
                    nn.init.zeros_(layer.bias)

    def forward(self, observation: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Logits and value, as stable-baselines3 takes them from an `mlp_extractor`."""
        return self.forward_actor(observation), self.forward_critic(observation)

    def forward_actor(self, observation: torch.Tensor) -> torch.Tensor:
        """(B, logits)."""
        belief, entry, outputs = self.sizes
        entries = observation[:, belief:].reshape(len(observation), -1, entry)
        if outputs > 1:
            entries = nn.functional.pad(entries, (0, 0, 1, 0))
        first = torch.relu(self.belief(observation[:, :belief])[:, None] + self.entry(entries))
        scores = self.score(torch.relu(self.hidden(first)))
        if outputs == 1:
            return scores[:, :, 0]
        awake = nn.functional.pad(scores[:, 1:, 1:], (1, 0))
        return torch.cat([scores[:, :, 0], awake.flatten(1)], dim=1)

    def forward_critic(self, observation: torch.Tensor) -> torch.Tensor:
        """(B, 1)."""
        return self.critic(observation)

    def actor_network(self) -> EntryNetwork:
        """The actor as NumPy arrays."""
        parts = {"belief": self.belief, "entry": self.entry, "hidden": self.hidden, "score": self.score}
        arrays = {}
        for name, layer in parts.items():
            arrays[f"{name}.weight"] = layer.weight.detach().cpu().numpy().T
            if layer.bias is not None:
                arrays[f"{name}.bias"] = layer.bias.detach().cpu().numpy()
        return EntryNetwork(arrays)


def entry_sizes(
    action: Literal["menu", "subset"], observation: Any, actor: tuple[int, int], critic: tuple[int, int]
) -> dict[str, Any]:
    """The arguments of EntryActorCritic that suit an environment.

    Args:
        action: what is chosen from.
        observation: the interface's, "menu" or "candidates".
        actor, critic: units of the two hidden layers.
    """
    return dict(
        belief=observation.belief,
        entry=observation.shape[1],
        observation=observation.space.shape[0],
        outputs=1 if action == "menu" else 2,
        actor=actor,
        critic=critic,
    )


class EntryPolicy(ActorCriticPolicy):
    """PPO's policy with an EntryActorCritic; `entries` are its arguments."""

    mlp_extractor: EntryActorCritic  # type: ignore[assignment]  # in the place of the library's own

    def __init__(self, *args: Any, entries: dict[str, Any] | None = None, **kwargs: Any) -> None:
        self.entries: dict[str, Any] = entries or {}
        super().__init__(*args, **kwargs)

    def _build(self, lr_schedule: Schedule) -> None:
        self.mlp_extractor = EntryActorCritic(**self.entries)
        # The network gives logits and values itself.
        self.action_net, self.value_net = nn.Identity(), nn.Identity()  # type: ignore[assignment]
        arguments: dict[str, Any] = {"lr": lr_schedule(1), **self.optimizer_kwargs}
        self.optimizer = self.optimizer_class(self.parameters(), **arguments)

    def _get_constructor_parameters(self) -> dict[str, Any]:
        return super()._get_constructor_parameters() | {"entries": self.entries}


def actor_network(model: PPO) -> PolicyNetwork:
    """The actor of a stable-baselines3 PPO model: an EntryPolicy's, or one with two tanh layers."""
    policy = model.policy
    if isinstance(policy, EntryPolicy):
        return policy.mlp_extractor.actor_network()
    layers = [*policy.mlp_extractor.policy_net, policy.action_net]
    linear = [layer for layer in layers if isinstance(layer, nn.Linear)]
    arrays = {}
    for i, layer in enumerate(linear):
        arrays[f"{i}.weight"] = layer.weight.detach().cpu().numpy().T
        arrays[f"{i}.bias"] = layer.bias.detach().cpu().numpy()
    return FlatNetwork(arrays)
