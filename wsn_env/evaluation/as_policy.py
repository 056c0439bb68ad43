"""Whatever maps observations to actions as a policy, so that it is compared like any other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from inspect import signature
from typing import Any

import numpy as np
from gymnasium.spaces import Discrete

from wsn_env.envs.actions import ActionName
from wsn_env.envs.interface import Interface, Settings
from wsn_env.envs.observations import ObservationName
from wsn_env.models.arguments import checked_but
from wsn_env.models.measurement.base import Order
from wsn_env.models.quantity import short
from wsn_env.models.state import Cluster
from wsn_env.scenario import Scenario
from wsn_env.simulation.view import View

Actor = Callable[[Any, Callable[[], np.ndarray]], Any]  # observations, and what gives masks -> actions


@checked_but("model", "candidates")
def as_policy(
    model: Any,
    action: ActionName = "menu",
    observation: ObservationName = "candidates",
    order: Order = "nearest",
    candidates: int = Settings.candidates,
) -> ForeignPolicy:
    """A model from any toolkit as a policy: `evaluate({"mine": as_policy(model)}, "PreDC-v0")`.

    Args:
        model: maps the observations of all rows to their actions, row by row and without a memory. One of
            stable-baselines3 or sb3-contrib (by its `predict`, deterministic, with masks if it takes them); a TorchRL
            module (its keys "observation" and "action", deterministic); any other torch.nn.Module; or a function. Of
            the menu's 28 entries it gives the number of one, or 28 numbers, of which the largest counts: one-hot
            actions and logits.
        action, observation, order, candidates: of the environment that it was trained in.

    Raises:
        ValueError: the model is none of these, has a memory, or is of other spaces.
    """
    return ForeignPolicy(_actor(model), model, Settings(action, observation, "error", order, candidates))


@dataclass(frozen=True, eq=False, repr=False)
class ForeignPolicy:
    """A model, until it is known in what scenario it acts."""

    actor: Actor
    model: Any
    settings: Settings

    def for_scenario(self, scenario: Scenario) -> ForeignScheduler:
        """It acts there.

        Raises:
            ValueError: the model is of other spaces.
        """
        interface = Interface(scenario, self.settings)
        for name, space in (("observation", interface.observation.space), ("action", interface.action.space)):
            own = getattr(self.model, f"{name}_space", None)
            if own is not None and (own.shape != space.shape or type(own) is not type(space)):
                raise ValueError(
                    f"as_policy: the model's {name} space {short(str(own))} is not {short(str(space))}, that of"
                    f" {name} = {getattr(self.settings, name)!r} in {scenario.name}"
                )
        return ForeignScheduler(self.actor, interface)


@dataclass(frozen=True, eq=False, repr=False)
class ForeignScheduler:
    """Chooses what a model chooses."""

    actor: Actor
    interface: Interface

    def act(self, view: View) -> Cluster:
        """The clusters of its actions."""
        observations = self.interface.observation.encode(view)
        actions = np.asarray(self.actor(observations, lambda: self.interface.action.masks(view)))
        space = self.interface.action.space
        if isinstance(space, Discrete) and actions.shape == (len(view.row), space.n):
            actions = actions.argmax(axis=1)  # one-hot
        return self.interface.action.cluster(actions, view)


def _actor(model: Any) -> Actor:
    if callable(getattr(model, "predict", None)):
        return _predicting(model)
    if hasattr(model, "in_keys") and hasattr(model, "out_keys"):
        return _TensorDictActor(model)
    if hasattr(model, "state_dict") and callable(model):
        return _ModuleActor(model)
    if callable(model):
        return _FunctionActor(model)
    raise ValueError(
        f"model = {short(repr(model))}: must map observations to actions: a function, a module, or a model"
    )


def _predicting(model: Any) -> Actor:
    if getattr(getattr(model, "policy", None), "lstm_actor", None) is not None:
        raise ValueError("model: has a memory, which a policy must not: score it with `score`")
    return _PredictActor(model, "action_masks" in signature(model.predict).parameters)


@dataclass(frozen=True)
class _FunctionActor:
    function: Callable[[Any], Any]

    def __call__(self, observations: Any, masks: Callable[[], np.ndarray]) -> Any:
        return self.function(observations)


@dataclass(frozen=True)
class _PredictActor:
    """Of stable-baselines3."""

    model: Any
    masked: bool

    def __call__(self, observations: Any, masks: Callable[[], np.ndarray]) -> Any:
        more = {"action_masks": masks()} if self.masked else {}
        return self.model.predict(observations, deterministic=True, **more)[0]


@dataclass(frozen=True)
class _ModuleActor:
    """Of torch: whatever it gives."""

    module: Any

    def __call__(self, observations: Any, masks: Callable[[], np.ndarray]) -> Any:
        import torch

        with torch.no_grad():
            return self.module(torch.as_tensor(observations)).numpy()


@dataclass(frozen=True)
class _TensorDictActor:
    """Of TorchRL."""

    module: Any

    def __call__(self, observations: Any, masks: Callable[[], np.ndarray]) -> Any:
        import torch
        from tensordict import TensorDict
        from tensordict.nn import InteractionType, set_interaction_type

        named = observations if isinstance(observations, dict) else {"observation": observations}
        tensors = {name: torch.as_tensor(values) for name, values in named.items()}
        told = TensorDict(tensors, batch_size=[len(next(iter(tensors.values())))])
        with torch.no_grad(), set_interaction_type(InteractionType.DETERMINISTIC):
            return self.module(told)["action"].numpy()
