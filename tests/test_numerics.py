"""Own elementary functions against NumPy's, over their whole ranges."""

import numba
import numpy as np
import pytest

from wsn_env import numerics

N = 200_000


def over(piece):
    """The function for a whole array."""

    @numba.njit
    def loop(xs, out):
        for i in range(len(xs)):
            out[i] = piece(xs[i])
        return out

    return lambda xs: loop(xs, np.empty_like(xs))


def ulps(got, exact):
    """Error in units of the last place of the exact value; `exact` in the longest precision there is."""
    return np.abs((got - exact) / np.spacing(np.abs(exact.astype(got.dtype)))).astype(float)


@pytest.fixture(scope="module")
def uniform():
    rng = np.random.default_rng(1)
    return lambda low, high: rng.uniform(low, high, N)


def test_log_is_within_two_ulp(uniform):
    log = over(numerics.log)
    tiny = np.finfo(float).tiny
    edges = np.array([tiny, 1.0, np.nextafter(1, 0), np.nextafter(1, 2), 0.5**0.5, 2**0.5, np.finfo(float).max])
    for x in (np.exp(uniform(-708, 709)), uniform(0.5, 2), 1 + uniform(-1e-9, 1e-9), edges):
        exact = np.log(x.astype(np.longdouble))
        assert ulps(log(x), exact)[exact != 0].max() <= 2
    assert numerics.log(1.0) == 0


def test_exp_is_within_two_ulp(uniform):
    exp = over(numerics.exp)
    edges = np.array([-708.0, -0.5, 0.0, 1e-300, 0.5, 1.0, 708.9, 709.0])
    for x in (uniform(-708, 709), uniform(-1, 1), uniform(-1e-9, 1e-9), edges):
        assert ulps(exp(x), np.exp(x.astype(np.longdouble))).max() <= 2
    assert numerics.exp(0.0) == 1


def test_exp_is_defined_outside_its_range():
    assert numerics.exp(-708.1) == numerics.exp(-np.inf) == 0
    assert np.isfinite(numerics.exp(np.inf)) and numerics.exp(1e300) == numerics.exp(709.0)


def test_sincos_is_within_1e15(uniform):
    edges = np.arange(-8, 9) * numerics.HALF_PI / 2
    for x in (uniform(-1e5, 1e5), uniform(-7, 7), uniform(-1e-9, 1e-9), edges):
        s, c = np.array([numerics.sincos(v) for v in x[:20_000]]).T
        exact = x[:20_000].astype(np.longdouble)
        assert np.abs(s - np.sin(exact)).max() <= 1e-15
        assert np.abs(c - np.cos(exact)).max() <= 1e-15


def test_log32_has_a_relative_error_below_2e7(uniform):
    log32 = over(numerics.log32)
    for x in (np.exp(uniform(-87, 88)), uniform(0.5, 2), 1 + uniform(-1e-3, 1e-3), np.array([2.0**-126, 2, 1e38])):
        x = x.astype(np.float32)
        x = x[x != 1]
        exact = np.log(x.astype(float))
        assert np.abs(log32(x) / exact - 1).max() < 2e-7
    assert numerics.log32(np.float32(1)) == 0


def test_exp32_has_a_relative_error_below_2e7_near_zero_and_never_vanishes(uniform):
    exp32 = over(numerics.exp32)
    near = uniform(-1, 0).astype(np.float32)
    assert np.abs(exp32(near) / np.exp(near.astype(float)) - 1).max() < 2e-7
    far = uniform(-87, 0).astype(np.float32)  # here the argument's rounding, half an ulp of 126, dominates
    assert np.abs(exp32(far) / np.exp(far.astype(float)) - 1).max() < 2e-7 + 126 * 2.0**-24
    below = np.array([-88, -1e4, -3e38, -np.inf], dtype=np.float32)
    assert (exp32(below) == np.float32(2.0**-126)).all()
    assert numerics.exp32(np.float32(0)) == 1


def test_tanh32_has_an_absolute_error_below_2e7(uniform):
    tanh32 = over(numerics.tanh32)
    for x in (uniform(-20, 20), uniform(-1, 1), uniform(-1e-3, 1e-3), np.array([-3e38, -100.0, 0.0, 100.0, 3e38])):
        x = x.astype(np.float32)
        assert np.abs(tanh32(x) - np.tanh(x.astype(float))).max() < 2e-7


def test_bit_casts_invert_each_other():
    for value in (0.0, -0.0, 1.5, -3e38, 1e-45, np.inf):
        single, double = np.float32(value), np.float64(value)
        assert numerics_bits(single, double) == (single.view(np.int32), double.view(np.int64), single, double)


@numba.njit
def numerics_bits(single, double):
    a, b = numerics.f32_bits(single), numerics.f64_bits(double)
    return a, b, numerics.f32_from_bits(a), numerics.f64_from_bits(b)
