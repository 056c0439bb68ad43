"""Policy networks from safetensors, run row by row in a fixed order: no torch, the same bits in any batch."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from wsn_env.compiled.elementary import F, tanh32
from wsn_env.compiled.kernels import kernel, piece
from wsn_env.evaluation.files import replacing
from wsn_env.models.arguments import checked


@piece
def _add_product(x: np.ndarray, w: np.ndarray, out: np.ndarray) -> None:
    """out += x w, in the order of x."""
    for i in range(len(w)):
        for j in range(len(out)):
            out[j] += x[i] * w[i, j]


@kernel
def _run_flat(observations: np.ndarray, weights: Any, out: np.ndarray) -> None:
    """Fill out (B, logits).

    Args:
        weights: FlatNetwork's arrays in order.
    """
    w0, b0, w1, b1, w2, b2 = weights
    h0, h1 = np.empty(len(b0), F), np.empty(len(b1), F)
    for row in range(len(observations)):
        h0[:] = b0
        _add_product(observations[row], w0, h0)
        for j in range(len(h0)):
            h0[j] = tanh32(h0[j])
        h1[:] = b1
        _add_product(h0, w1, h1)
        for j in range(len(h1)):
            h1[j] = tanh32(h1[j])
        out[row] = b2
        _add_product(h1, w2, out[row])


@kernel
def _run_entries(observations: np.ndarray, weights: Any, out: np.ndarray) -> None:
    """Fill out (B, K, outputs).

    Args:
        weights: EntryNetwork's arrays in order.
    """
    belief_w, belief_b, entry_w, hidden_w, hidden_b, score_w, score_b = weights
    size, width = belief_w.shape[0], entry_w.shape[0]
    context, h0, h1 = np.empty(len(belief_b), F), np.empty(len(belief_b), F), np.empty(len(hidden_b), F)
    for row in range(len(observations)):
        context[:] = belief_b
        _add_product(observations[row, :size], belief_w, context)
        for k in range(out.shape[1]):
            h0[:] = context
            _add_product(observations[row, size + k * width : size + (k + 1) * width], entry_w, h0)
            for j in range(len(h0)):
                h0[j] = max(h0[j], F(0))
            h1[:] = hidden_b
            _add_product(h0, hidden_w, h1)
            for j in range(len(h1)):
                h1[j] = max(h1[j], F(0))
            out[row, k] = score_b
            _add_product(h1, score_w, out[row, k])


class PolicyNetwork:
    """Base: float32 arrays by name whose shapes fit each other, as a subclass's SHAPES says.

    Args:
        arrays: one for each name.
    """

    SHAPES: ClassVar[dict[str, tuple[str, ...]]]

    def __init__(self, arrays: dict[str, np.ndarray]) -> None:
        self.arrays: dict[str, np.ndarray] = {name: np.ascontiguousarray(arrays[name], F) for name in self.SHAPES}
        self.sizes: dict[str, int] = {}
        for name, axes in self.SHAPES.items():
            shape = self.arrays[name].shape
            if len(shape) != len(axes) or any(self.sizes.setdefault(a, n) != n for a, n in zip(axes, shape)):
                raise ValueError(f"network array {name} of shape {shape} does not fit its neighbours")
            if 0 in shape:
                raise ValueError(f"network array {name} of shape {shape} is empty")
            if not np.isfinite(self.arrays[name]).all():
                raise ValueError(f"network array {name} has weights that are not finite")

    def logits(self, observations: np.ndarray) -> np.ndarray:
        """(B, logits) float32 from observations (B, observation) float32."""
        raise NotImplementedError

    @checked
    def save(self, path: str | Path) -> None:
        """Write a safetensors file."""
        from safetensors.numpy import save

        with replacing(path) as temporary:
            temporary.write_bytes(save(self.arrays))

    @staticmethod
    @checked
    def load(path: str | Path) -> FlatNetwork | EntryNetwork:
        """Read a safetensors file of either kind; nothing in it is executed.

        Raises:
            ValueError: when the file is missing, cut short or of another shape.
        """
        from safetensors import SafetensorError
        from safetensors.numpy import load_file

        if not Path(path).is_file():
            raise ValueError(f"{path} is not a saved network: there is no such file")
        try:
            arrays = load_file(str(path))
            other = {name: array.dtype for name, array in arrays.items() if array.dtype != F}
            if other:
                raise ValueError(f"its arrays must be float32: {next(iter(other))} is {next(iter(other.values()))}")
            return (EntryNetwork if "entry.weight" in arrays else FlatNetwork)(arrays)
        except KeyError as problem:
            raise ValueError(f"{path} is not a saved network: it lacks the array {problem}") from None
        except (OSError, SafetensorError, ValueError, TypeError, AttributeError) as problem:  # bfloat16, float8
            raise ValueError(f"{path} is not a saved network of float32, or it is cut short: {problem}") from None


class FlatNetwork(PolicyNetwork):
    """Two hidden layers of tanh and a linear output: the actor of stable-baselines3's MlpPolicy."""

    SHAPES = {
        "0.weight": ("observation", "first"),
        "0.bias": ("first",),
        "1.weight": ("first", "second"),
        "1.bias": ("second",),
        "2.weight": ("second", "logits"),
        "2.bias": ("logits",),
    }

    def logits(self, observations: np.ndarray) -> np.ndarray:
        """(B, logits) float32 from observations (B, observation) float32."""
        out = np.empty((len(observations), self.sizes["logits"]), F)
        _run_flat(np.ascontiguousarray(observations, F), tuple(self.arrays.values()), out)
        return out

    def fits(self, inputs: int, logits: int) -> bool:
        """Whether it maps so many numbers to so many."""
        return (inputs, logits) == (self.sizes["observation"], self.sizes["logits"])


class EntryNetwork(PolicyNetwork):
    """Scores each entry of a choice by what is known of it and of the belief, with the same weights for all:

        relu(relu(belief W_b + b + entry W_e) W_h + b_h) W_s + b_s

    Neither the number of entries nor that of nodes is part of it. One output an entry is a menu's logit. With two, the
    entries are candidates, and an empty one stands before them for the present head: its first output is the logit of
    leading, the second that of being awake (MultiDiscrete's logits in the order of SubsetAction).
    """

    SHAPES = {
        "belief.weight": ("belief", "first"),
        "belief.bias": ("first",),
        "entry.weight": ("entry", "first"),
        "hidden.weight": ("first", "second"),
        "hidden.bias": ("second",),
        "score.weight": ("second", "outputs"),
        "score.bias": ("outputs",),
    }

    def logits(self, observations: np.ndarray) -> np.ndarray:
        """(B, logits) float32 from observations (B, belief + K * entry) float32."""
        belief, entry, outputs = (self.sizes[axis] for axis in ("belief", "entry", "outputs"))
        observations = np.ascontiguousarray(observations, F)
        if outputs > 1:
            nobody = np.zeros((len(observations), entry), F)
            observations = np.concatenate([observations[:, :belief], nobody, observations[:, belief:]], axis=1)
        out = np.empty((len(observations), (observations.shape[1] - belief) // entry, outputs), F)
        _run_entries(observations, tuple(self.arrays.values()), out)
        if outputs == 1:
            return out[:, :, 0]
        awake = np.stack([np.zeros_like(out[:, 1:, 1]), out[:, 1:, 1]], axis=2)
        return np.concatenate([out[:, :, 0], awake.reshape(len(out), -1)], axis=1)

    def fits(self, inputs: int, logits: int) -> bool:
        """Whether it maps so many numbers to so many."""
        entries, left = divmod(inputs - self.sizes["belief"], self.sizes["entry"])
        return left == 0 and logits == (entries if self.sizes["outputs"] == 1 else 1 + 3 * entries)
