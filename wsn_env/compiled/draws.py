"""Randomness by key: every draw is a function of (row key, period, purpose, index) and of nothing else.

So the target's track, and what a node would detect and measure in a period, cannot depend on what a policy
did, on the other rows of a batch or on threads: policies meet common random numbers by construction.

The generator is SplitMix64 (Steele, Lea & Flood, 2014) read as a hash of a counter. The counter runs from a
start that is one hash of the stream, and a second, independent hash enters between the two mixing rounds: two
streams whose counters happen to overlap still give unrelated numbers.
"""

from typing import Any

import numpy as np
from numba import int32, uint64

from wsn_env.compiled.elementary import HALF_PI, F, f32_bits, f32_from_bits, log, log32, sincos
from wsn_env.compiled.kernels import kernel, piece

# Purposes, one a use: adding one changes no other draw.
FIELD, START, TRACK, LAM, DETECTION, MEASUREMENT, PACKET, PROCESS, RESAMPLING, RESTART, POLICY, CLOUD = range(12)
SEARCH_PACKET, SPREAD, HANDOVER, MISREADING, STRENGTH = range(12, 17)
BEACON_FIELD, BEACON_DRIFT, BEACON_NOISE, BEACON_LOSS = range(16, 20)  # of receivers, for whole episodes
RADIUS = 20  # of nodes, for good
BATTERY = 21
FAULT, MISS, FALSE_ALARM, CHANNEL, LATE = range(22, 27)
CLUTTER = 27

GOLDEN = uint64(0x9E3779B97F4A7C15)
MIX_1, MIX_2 = uint64(0xBF58476D1CE4E5B9), uint64(0x94D049BB133111EB)


def episode_key(generator: np.random.Generator) -> np.uint64:
    """The key of a row's next episode, from the row's own Gymnasium generator."""
    return generator.integers(2**64, dtype=np.uint64)


def key_of_seed(seed: int) -> np.uint64:
    """The key of the first episode after `reset(seed=seed)` of a Gymnasium environment."""
    return episode_key(np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed))))


def target_keys(keys: np.ndarray, targets: int) -> np.ndarray:
    """Keys of targets 0, 1, ... of each field, row by row; the first one's is the field's.

    Args:
        keys: (B * targets,) uint64, each field's as often as it has targets.
    """
    steps = np.arange(len(keys), dtype=np.uint64) % np.uint64(targets)
    return keys ^ (steps * np.uint64(0x9E3779B97F4A7C15))  # `stream` hashes it


@piece
def mix(z: Any) -> Any:
    """SplitMix64's finaliser: a bijection of 64 bits."""
    z = (z ^ (z >> uint64(30))) * MIX_1
    z = (z ^ (z >> uint64(27))) * MIX_2
    return z ^ (z >> uint64(31))


@piece
def stream(key: Any, period: int, purpose: int) -> tuple[Any, ...]:
    """The two 64-bit halves of a stream's key."""
    a = mix(mix(key + GOLDEN) ^ (uint64(period) * uint64(0xD1342543DE82EF95) + uint64(purpose) * GOLDEN))
    return a, mix(a ^ uint64(0x5851F42D4C957F2D))


@piece
def bits(stream: Any, index: int) -> Any:
    """64 random bits: number `index` of a stream."""
    start, inner = stream
    z = start + uint64(index) * GOLDEN
    z = (z ^ (z >> uint64(30))) * MIX_1 + inner
    z = (z ^ (z >> uint64(27))) * MIX_2
    return z ^ (z >> uint64(31))


@piece
def uniform(stream: Any, index: int) -> float:
    """U[0, 1) with 53 bits."""
    return np.float64(bits(stream, index) >> uint64(11)) * 1.1102230246251565e-16


@piece
def normal_pair(stream: Any, index: int) -> tuple[float, float]:
    """Two independent N(0, 1) doubles, by Box and Muller's transform of draws 2 index and 2 index + 1."""
    radius = np.sqrt(-2.0 * log(uniform(stream, 2 * index) + 5.551115123125783e-17))
    s, c = sincos(4.0 * HALF_PI * uniform(stream, 2 * index + 1))
    return radius * c, radius * s


@piece
def normal_pair32(h: Any) -> tuple[Any, ...]:
    """Two independent N(0, 1) float32 from 64 random bits, without a branch: 24 bits give the radius (so |z| < 5.9),
    24 the angle within a quadrant, two the quadrant."""
    low = int32(h & uint64(0xFFFFFF))
    high = int32(h >> uint64(32))
    u = (F(low) + F(0.5)) * F(5.9604644775390625e-08)
    t = (F(high & int32(0xFFFFFF)) + F(0.5)) * F(9.3623573e-08) - F(0.78539816339)
    t2 = t * t
    sin = t + t * t2 * (F(-1.6666654611e-1) + t2 * (F(8.3321608736e-3) + t2 * F(-1.9515295891e-4)))
    cos = (
        F(1)
        - F(0.5) * t2
        + t2 * t2 * (F(4.166664568298827e-02) + t2 * (F(-1.388731625493765e-3) + t2 * F(2.443315711809948e-5)))
    )
    radius = np.sqrt(-log32(u))  # cos - sin and cos + sin bring the factor sqrt(2)
    sign = int32(-2147483648)
    return (
        f32_from_bits(int32(f32_bits(radius * (cos - sin)) ^ (int32(high << int32(7)) & sign))),
        f32_from_bits(int32(f32_bits(radius * (cos + sin)) ^ (int32(high << int32(6)) & sign))),
    )


@kernel
def _uniform_rows(seeds, out):
    for b in range(len(seeds)):
        s = stream(uint64(seeds[b]), 0, POLICY)
        for i in range(out.shape[1]):
            out[b, i] = uniform(s, i)


def uniforms(seeds: Any, count: int) -> np.ndarray:
    """U[0, 1) numbers for policies: (B, count) from the view's `random_bits` (B,), alike in every batch."""
    out = np.empty((len(seeds), count))
    _uniform_rows(np.array(seeds, dtype=np.uint32), out)  # a copy: of read-only arrays it would be compiled once more
    return out
