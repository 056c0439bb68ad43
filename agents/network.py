"""A small dense network from safetensors, run row by row in a fixed order: no torch, the same bits in any batch."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wsn_env.compiling import kernel
from wsn_env.numerics import F, tanh32


@kernel
def _forward(observations, w0, b0, w1, b1, w2, b2, out):
    h0, h1 = np.empty(len(b0), np.float32), np.empty(len(b1), np.float32)
    for row in range(len(observations)):
        h0[:] = b0
        for i in range(len(w0)):
            x = observations[row, i]
            for j in range(len(h0)):
                h0[j] += x * w0[i, j]
        for j in range(len(h0)):
            h0[j] = tanh32(h0[j])
        h1[:] = b1
        for i in range(len(w1)):
            x = h0[i]
            for j in range(len(h1)):
                h1[j] += x * w1[i, j]
        for j in range(len(h1)):
            h1[j] = tanh32(h1[j])
        for j in range(len(b2)):
            out[row, j] = b2[j]
        for i in range(len(w2)):
            x = h1[i]
            for j in range(len(b2)):
                out[row, j] += x * w2[i, j]


class Network:
    """Two hidden layers of tanh and a linear output: the actor of a PPO policy.

    Args:
        layers: three pairs of weights (in, out) and biases (out,), float32.
    """

    def __init__(self, layers: list[tuple[np.ndarray, np.ndarray]]):
        if len(layers) != 3:
            raise ValueError(f"network has {len(layers)} layers: must have two hidden ones and the output")
        self.layers = [(np.ascontiguousarray(w, F), np.ascontiguousarray(b, F)) for w, b in layers]
        for (w, b), (after, _) in zip(self.layers, self.layers[1:] + [(np.empty((len(self.layers[-1][1]), 0)), None)]):
            if not (np.isfinite(w).all() and np.isfinite(b).all()):
                raise ValueError("network has weights that are not finite")
            if w.ndim != 2 or w.shape[1] != len(b) or len(after) != len(b):
                raise ValueError(f"network layer of shape {w.shape} does not fit its neighbours")

    @property
    def inputs(self) -> int:
        """Length of an observation."""
        return len(self.layers[0][0])

    @property
    def outputs(self) -> int:
        """Number of logits."""
        return len(self.layers[-1][1])

    def logits(self, observations: np.ndarray) -> np.ndarray:
        """(B, outputs) float32 from observations (B, inputs) float32."""
        out = np.empty((len(observations), self.outputs), F)
        _forward(np.ascontiguousarray(observations, F), *(array for layer in self.layers for array in layer), out)
        return out

    def save(self, path: str | Path) -> None:
        """Write a safetensors file."""
        from safetensors.numpy import save

        tensors = {}
        for i, (w, b) in enumerate(self.layers):
            tensors[f"{i}.weight"], tensors[f"{i}.bias"] = w, b
        Path(path).write_bytes(save(tensors))

    @classmethod
    def load(cls, path: str | Path) -> Network:
        """Read a safetensors file; nothing in it is executed.

        Raises:
            ValueError: when the file is missing, cut short or of another shape.
        """
        from safetensors import SafetensorError
        from safetensors.numpy import load_file

        try:
            tensors = load_file(str(path))
            return cls([(tensors[f"{i}.weight"], tensors[f"{i}.bias"]) for i in range(3)])
        except (OSError, SafetensorError, KeyError, ValueError) as problem:
            raise ValueError(f"{path} is not a saved network, or it is cut short: {problem}") from None
