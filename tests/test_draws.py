"""Draws by key: their distributions, their independence, and where the keys come from."""

import gymnasium as gym
import numba
import numpy as np
import pytest
from numba import uint64
from scipy import stats

import wsn_env  # noqa: F401 (registers the environments)
from wsn_env.compiled import draws

N = 400_000
SIGNIFICANT = 1e-4  # p value below which a fixed-seed test of a distribution fails
PURPOSES = [
    draws.FIELD,
    draws.START,
    draws.TRACK,
    draws.LAM,
    draws.DETECTION,
    draws.MEASUREMENT,
    draws.PACKET,
    draws.PROCESS,
    draws.RESAMPLING,
    draws.RESTART,
    draws.POLICY,
    draws.CLOUD,
]


@numba.njit
def uniforms(key, period, purpose, count):
    stream = draws.stream(uint64(key), period, purpose)
    return np.array([draws.uniform(stream, i) for i in range(count)])


@numba.njit
def normals(key, count):
    stream = draws.stream(uint64(key), 3, draws.MEASUREMENT)
    out = np.empty((2, count))
    for i in range(count):
        out[0, i], out[1, i] = draws.normal_pair(stream, i)
    return out


@numba.njit
def normals32(key, count):
    stream = draws.stream(uint64(key), 3, draws.PROCESS)
    out = np.empty((2, count), np.float32)
    for i in range(count):
        out[0, i], out[1, i] = draws.normal_pair32(draws.bits(stream, i))
    return out


@numba.njit
def raw(start, inner, count):
    return np.array([draws.uniform((uint64(start), uint64(inner)), i) for i in range(count)])


def correlation_bound(count):
    """Five standard errors of the correlation of independent samples."""
    return 5 / count**0.5


def test_uniforms_are_uniform():
    u = uniforms(7, 1, draws.DETECTION, N)
    assert 0 <= u.min() and u.max() < 1
    assert abs(u.mean() - 1 / 2) < 4 * (1 / 12 / N) ** 0.5
    assert abs(u.var() - 1 / 12) < 4 * (1 / 180 / N) ** 0.5
    assert stats.kstest(u, "uniform").pvalue > SIGNIFICANT
    assert stats.kstest(u * 2**20 % 1, "uniform").pvalue > SIGNIFICANT  # the low bits too


@pytest.mark.parametrize("draw", [normals, normals32])
def test_normals_are_normal(draw):
    pair = draw(11, N).astype(float)
    for z in pair:
        assert abs(z.mean()) < 4 / N**0.5
        assert abs(z.var() - 1) < 4 * (2 / N) ** 0.5
        assert abs((z**3).mean()) < 4 * (15 / N) ** 0.5
        assert abs((z**4).mean() - 3) < 4 * (96 / N) ** 0.5
        assert stats.kstest(z, "norm").pvalue > SIGNIFICANT
    for f in (lambda z: z, lambda z: z**2, np.abs, np.sign):
        assert abs(np.corrcoef(f(pair[0]), f(pair[1]))[0, 1]) < correlation_bound(N)
    angle = np.arctan2(*pair)
    assert stats.kstest(angle, stats.uniform(-np.pi, 2 * np.pi).cdf).pvalue > SIGNIFICANT


def test_float32_normals_stay_below_their_bound():
    extremes = [0, 2**64 - 1, 0xFFFFFF, 0xFFFFFF << 32, 1 << 63, 0xFF << 24]
    pairs = np.array([draws.normal_pair32(np.uint64(h)) for h in extremes])
    assert np.isfinite(pairs).all() and np.abs(pairs).max() < 5.9


def independent(streams):
    """No two of the rows (n, N) are correlated, at any lag of up to two draws."""
    n, count = streams.shape
    rows = streams - 0.5
    for lag in range(3):
        moved = np.roll(rows, lag, axis=1)
        r = 12 * rows @ moved.T / count
        if lag == 0:
            r = r - np.diag(np.diag(r))
        assert np.abs(r).max() < correlation_bound(count), (lag, np.abs(r).max())


def test_streams_of_neighbouring_keys_are_independent():
    keys = [*range(8), 2**63, 2**64 - 1]
    independent(np.array([uniforms(np.uint64(key), 1, draws.TRACK, 40_000) for key in keys]))


def test_streams_of_periods_are_independent():
    independent(np.array([uniforms(5, period, draws.MEASUREMENT, 40_000) for period in range(12)]))


def test_streams_of_purposes_are_independent():
    assert len(set(PURPOSES)) == len(PURPOSES)
    independent(np.array([uniforms(5, 1, purpose, 40_000) for purpose in PURPOSES]))


def test_the_first_draws_of_many_streams_are_uniform_and_uncorrelated():
    first = np.array([uniforms(key, period, 4, 2) for key in range(400) for period in range(50)])
    assert stats.kstest(first[:, 0], "uniform").pvalue > SIGNIFICANT
    assert abs(np.corrcoef(first.T)[0, 1]) < correlation_bound(len(first))
    assert abs(np.corrcoef(first[:-1, 0], first[1:, 0])[0, 1]) < correlation_bound(len(first))


def test_streams_whose_counters_overlap_are_independent():
    start, shift = 123456789, 5
    ahead = (start + shift * int(draws.GOLDEN)) % 2**64
    for inner, other in np.random.default_rng(0).integers(2**64, size=(12, 2), dtype=np.uint64):
        a, b = raw(start, inner, 40_000), raw(np.uint64(ahead), other, 40_000)
        assert not (a[shift:] == b[:-shift]).any()
        independent(np.array([a[shift:], b[:-shift]]))


def test_no_streams_coincide():
    streams = {draws.stream(np.uint64(k), t, p) for k in range(30) for t in range(101) for p in PURPOSES}
    assert len(streams) == 30 * 101 * len(PURPOSES)


def test_a_draw_is_a_function_of_its_key():
    np.testing.assert_array_equal(uniforms(9, 2, 3, 10), uniforms(9, 2, 3, 20)[:10])


def test_policies_draw_alike_in_every_batch():
    seeds = np.array([3, 2**32 - 1, 0, 77], np.uint32)
    together = draws.uniforms(seeds, 6)
    for b in range(4):
        np.testing.assert_array_equal(draws.uniforms(seeds[b : b + 1], 6), together[b : b + 1])
    assert ((together >= 0) & (together < 1)).all() and len(np.unique(together)) == together.size


@pytest.mark.parametrize("seed", [0, 1, 2**31 - 1, 2**31 + 3 * 10**5 + 17])
def test_key_of_seed_is_the_environments_first_key(seed):
    env = gym.make("wsn_env/PreDC-v0", particles=10)
    env.reset(seed=seed)
    assert env.unwrapped._state.key[0] == draws.key_of_seed(seed)
    second = draws.episode_key(env.unwrapped.np_random)
    assert second != draws.key_of_seed(seed)
