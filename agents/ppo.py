"""A trained PPO scheduler as a policy: policy.json says how it sees and acts, policy.safetensors holds its network."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path

from agents.base import ViewPolicy
from agents.network import Network
from wsn_env.files import replacing
from wsn_env.interface import Interface, Settings
from wsn_env.types import Cluster
from wsn_env.view import View


@dataclass(frozen=True, repr=False)
class PPOPolicy(ViewPolicy):
    """Takes the most probable action of the network that `train.py` saved at `path` (a policy.json)."""

    path: str = ""

    def __repr__(self):
        """Tells it from others by what it has learned."""
        weights = b"".join(array.tobytes() for layer in self._parts[1].layers for array in layer)
        return f"PPOPolicy({self.path!r}, weights {hashlib.sha256(weights).hexdigest()[:16]})"

    @cached_property
    def _parts(self) -> tuple[Interface, Network]:
        if not self.path:
            raise ValueError("policy 'ppo' is learned: name the policy.json that train.py saved instead")
        path = Path(self.path)
        try:
            saved = json.loads(path.read_text())
            settings = Settings(**saved["interface"])
            if (settings.action, settings.observation) != ("menu", "candidates"):
                raise ValueError(f"{path}: speaks {settings}: must be action menu, observation candidates")
            interface = Interface(self.scenario, settings)
        except (OSError, KeyError, TypeError, UnicodeDecodeError) as problem:
            raise ValueError(f"{path} is not a saved policy: {problem!r}") from None
        network = Network.load(path.with_suffix(".safetensors"))
        wanted = interface.observation.space.shape[0], interface.action.space.n
        if (network.inputs, network.outputs) != wanted:
            raise ValueError(
                f"{path}: its network maps {network.inputs} numbers to {network.outputs}, the environment {wanted}"
            )
        return interface, network

    def act(self, view: View) -> Cluster:
        """The most probable entry of the menu, for every row."""
        interface, network = self._parts
        logits = network.logits(interface.observation.encode(view))
        return interface.action.cluster(logits.argmax(axis=1), view)


def save_policy(folder: str | Path, network: Network, settings: Settings, facts: dict) -> Path:
    """Write policy.safetensors and policy.json; the latter last, so that a policy.json always has its network.

    Args:
        folder: exists.
        network: the actor.
        settings: how the environment that it was trained in spoke.
        facts: anything worth knowing about the training, JSON values.

    Returns: path of policy.json.
    """
    folder = Path(folder)
    with replacing(folder / "policy.safetensors") as path:
        network.save(path)
    with replacing(folder / "policy.json") as path:
        path.write_text(json.dumps({"kind": "ppo", "interface": asdict(settings)} | facts, indent=1))
    return folder / "policy.json"


def network_of(model) -> Network:
    """The actor of a stable-baselines3 PPO model with two tanh layers."""
    policy = model.policy
    linear = [m for m in [*policy.mlp_extractor.policy_net, policy.action_net] if hasattr(m, "weight")]
    return Network([(m.weight.detach().cpu().numpy().T, m.bias.detach().cpu().numpy()) for m in linear])
