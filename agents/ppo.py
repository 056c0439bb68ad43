"""A trained PPO scheduler as a policy: policy.json says how it sees and acts, policy.safetensors holds its network.

Trained ones come with the package for the scenarios in `pretrained/`; its README says how each was made.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from wsn_env.agents.base import ViewPolicy
from wsn_env.envs.interface import Interface, Settings, logit_counts
from wsn_env.envs.scarcity import MOST, energy_prices
from wsn_env.evaluation.files import replacing
from wsn_env.evaluation.policies import read_saved
from wsn_env.learning.network import EntryNetwork, FlatNetwork, PolicyNetwork
from wsn_env.models.arguments import checked
from wsn_env.models.own_files import file_digest
from wsn_env.models.quantity import check_quantity, short
from wsn_env.models.state import Cluster
from wsn_env.scenario import Scenario
from wsn_env.simulation.view import View

PRETRAINED = Path(__file__).parent / "pretrained"
DIGEST = "sha256"  # of policy.safetensors
PRICE = "price"  # and steering, of energy
INTERFACES = (("menu", "menu"), ("menu", "candidates"), ("subset", "candidates"))


@dataclass(frozen=True, repr=False)
class PPOPolicy(ViewPolicy):
    """Takes the most probable action of the network that `train.py` saved at `path` (a policy.json); left out: of the
    one that comes with the package for the scenario named `of`, or left out, too, for the scenario of this name.

    One that was trained where energy is not scarce sees nothing of it where it is. One that was trained at a price
    that follows what is left acts, where lam is 0, at the price that was found for it (`energy_prices`).
    """

    path: str | Path = ""
    of: str = ""

    def __post_init__(self) -> None:
        """Read the files now: a missing one is known before anybody plays."""
        _ = self._interface_and_network, self._price

    def __repr__(self) -> str:
        """Tells it from others by what it has learned."""
        weights = b"".join(array.tobytes() for array in self._interface_and_network[1].arrays.values())
        price = "" if self._price is None else f", price {self._price}"
        return f"PPOPolicy({str(self.path)!r}, weights {hashlib.sha256(weights).hexdigest()[:16]}{price})"

    def __getstate__(self) -> dict[str, Any]:
        """It takes its network along to machines that lack the file."""
        return self.__dict__ | {"_interface_and_network": self._interface_and_network, "_price": self._price}

    @property
    def _path(self) -> Path:
        return Path(self.path or PRETRAINED / (self.of or self.scenario.name) / "policy.json")

    @cached_property
    def _price(self) -> tuple[float, float] | None:
        """Price and steering, where it has one."""
        (said,) = read_saved(self._path, optional=(PRICE,))
        if said is None:
            return None
        try:
            price, steering = said
            check_quantity("price", "price", price, above=0, at_most=MOST)
            check_quantity("price", "steering", steering, at_least=0, at_most=100)
        except (TypeError, ValueError) as problem:
            raise ValueError(f"{self._path} is not a saved policy: {PRICE}: {problem}") from None
        return price, steering

    @cached_property
    def _scarce(self) -> Scenario:
        return self.scenario.override(scarce_energy=True)

    @cached_property
    def _interface_and_network(self) -> tuple[Interface, FlatNetwork | EntryNetwork]:
        home, path = self.of or self.scenario.name, self._path
        if not self.path and not path.exists():
            shipped = ", ".join(sorted(folder.name for folder in PRETRAINED.iterdir() if folder.is_dir()))
            if self.of:
                raise ValueError(f"PPOPolicy.of = {short(repr(self.of))}: allowed are {shipped}")
            raise ValueError(
                f"policy 'ppo': none comes with the package for {home}, only for {shipped}: train one"
                " with train.py and name its policy.json"
            )
        said, digest = read_saved(path, "interface", DIGEST)
        try:
            settings = Settings(**said)
            if (settings.action, settings.observation) not in INTERFACES:
                pair = settings.action, settings.observation
                raise ValueError(f"(action, observation) = {pair}: must be one of {INTERFACES}")
            # It may have been trained without what observations tell in this scenario.
            interfaces = [
                Interface(self.scenario.override(scarce_energy=scarce, tells_others=others), settings)
                for scarce in dict.fromkeys((self.scenario.scarce_energy, False))
                for others in dict.fromkeys((self.scenario.tells_others, False, True))
            ]
        except (TypeError, ValueError) as problem:
            raise ValueError(f"{path} is not a saved policy: {problem}") from None
        weights = path.with_suffix(".safetensors")
        network = PolicyNetwork.load(weights)
        if digest != file_digest(weights):
            raise ValueError(f"{weights} is not the network that {path} was saved with: it is damaged, or another's")
        for interface in interfaces:
            inputs, logits = interface.observation.space.shape[0], sum(logit_counts(interface.action.space))
            if network.fits(inputs, logits):
                return interface, network
        raise ValueError(f"{path}: its network does not map {inputs} numbers to {logits}, as the environment wants")

    def act(self, view: View) -> Cluster:
        """The most probable action, for every row."""
        if self._price is not None and (view.lam == 0.0).any():
            own = energy_prices(view, self._scarce, *self._price)
            view = view.at_lam(np.where(view.lam == 0.0, own, view.lam))
        interface, network = self._interface_and_network
        return interface.most_probable(network.logits(interface.observation.encode(view)), view)


@checked
def save_policy(folder: str | Path, network: PolicyNetwork, settings: Settings, facts: dict[str, Any]) -> Path:
    """Write policy.safetensors and policy.json; the latter last, so that a policy.json always has its network.

    Args:
        folder: exists.
        network: the actor.
        settings: the interface of the environment that it was trained in.
        facts: anything worth knowing about the training, JSON values.

    Returns: path of policy.json.
    """
    folder = Path(folder)
    network.save(folder / "policy.safetensors")
    said = {"kind": "ppo", "interface": asdict(settings), DIGEST: file_digest(folder / "policy.safetensors")}
    with replacing(folder / "policy.json") as path:
        path.write_text(json.dumps(said | facts, indent=1), encoding="utf-8")
    return folder / "policy.json"
