"""stable-baselines3 policies whose actor scores entries: the torch twin of `EntryNetwork`."""

from __future__ import annotations

from typing import Any, Literal

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.type_aliases import Schedule
from torch import nn

from wsn_env.learning.network import EntryNetwork, FlatNetwork, PolicyNetwork

CHUNK = 256


class EntryScores(torch.autograd.Function):
    """EntryNetwork's formula and its gradient by hand, a few rows at a time: 1.7 times as fast as torch's own."""

    @staticmethod
    def forward(ctx: Any, belief: torch.Tensor, entries: torch.Tensor, *weights: torch.Tensor) -> torch.Tensor:
        """(B, K, outputs) of belief (B, n) and entries (B, K, m)."""
        belief_w, belief_b, entry_w, hidden_w, hidden_b, score_w, score_b = weights
        kept: list[torch.Tensor] = []
        scores: list[torch.Tensor] = []
        for own, each in zip(belief.split(CHUNK), entries.split(CHUNK)):
            first = each.matmul(entry_w.T).add_(own.mm(belief_w.T).add_(belief_b)[:, None]).relu_().flatten(0, 1)
            second = torch.addmm(hidden_b, first, hidden_w.T).relu_()
            scores.append(torch.addmm(score_b, second, score_w.T))
            kept += first, second
        ctx.save_for_backward(belief, entries, *weights, *kept)
        return torch.cat(scores).view(*entries.shape[:2], -1)

    @staticmethod
    def backward(ctx: Any, *gradients: Any) -> Any:
        """Of the weights alone."""
        (belief, entries, *rest) = ctx.saved_tensors
        weights, kept = rest[:7], rest[7:]
        _, _, _, hidden_w, _, score_w, _ = weights
        sums = [torch.zeros_like(each) for each in weights]
        belief_w, belief_b, entry_w, into_hidden, hidden_b, into_score, score_b = sums
        chunks = (each.split(CHUNK) for each in (belief, entries, gradients[0]))
        for own, each, gradient, first, second in zip(*chunks, kept[::2], kept[1::2]):
            gradient = gradient.flatten(0, 1)
            into_score.addmm_(gradient.T, second)
            score_b += gradient.sum(0)
            gradient = torch.ops.aten.threshold_backward(gradient.mm(score_w), second, 0)
            into_hidden.addmm_(gradient.T, first)
            hidden_b += gradient.sum(0)
            gradient = torch.ops.aten.threshold_backward(gradient.mm(hidden_w), first, 0)
            entry_w.addmm_(gradient.T, each.flatten(0, 1))
            gradient = gradient.view(*each.shape[:2], -1).sum(1)
            belief_w.addmm_(gradient.T, own)
            belief_b += gradient.sum(0)
        return None, None, *sums


class EntryActorCritic(nn.Module):
    """Actor: `EntryNetwork`. Critic: a flat network of the whole observation, two layers of tanh; it only serves
    training, and may see what the actor does not.

    Args:
        belief, entry: lengths of the observation's head and of each of its entries.
        entries: how many they are; what follows them is for the critic alone.
        observation: its whole length.
        outputs: 1: a logit for each entry (menu); 2: leading and being awake (subset).
        actor, critic: units of the two hidden layers.
    """

    def __init__(
        self,
        belief: int,
        entry: int,
        entries: int,
        observation: int,
        outputs: int,
        actor: tuple[int, int],
        critic: tuple[int, int],
    ) -> None:
        super().__init__()
        self.sizes: tuple[int, int, int, int] = belief, entry, entries, outputs
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
        belief, entry, count, outputs = self.sizes
        entries = observation[:, belief : belief + count * entry].reshape(len(observation), count, entry)
        if outputs > 1:
            entries = nn.functional.pad(entries, (0, 0, 1, 0))
        weights = (
            *(self.belief.weight, self.belief.bias, self.entry.weight),
            *(self.hidden.weight, self.hidden.bias, self.score.weight, self.score.bias),
        )
        scores = EntryScores.apply(observation[:, :belief], entries, *weights)
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
    action: Literal["menu", "subset"],
    observation: Any,
    seen: int,
    actor: tuple[int, int],
    critic: tuple[int, int],
) -> dict[str, Any]:
    """The arguments of EntryActorCritic that suit an environment.

    Args:
        action: what is chosen from.
        observation: the interface's, "menu" or "candidates".
        seen: length of what the critic sees.
        actor, critic: units of the two hidden layers.
    """
    return dict(
        belief=observation.belief,
        entry=observation.shape[1],
        entries=observation.shape[0],
        observation=seen,
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
