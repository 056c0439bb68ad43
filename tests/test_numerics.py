"""Own elementary functions against NumPy's, over their whole ranges."""

import numba
import numpy as np
import pytest
from scipy import special

from wsn_env.compiled import draws
from wsn_env.compiled import elementary as numerics
from wsn_env.compiled.kernels import fast, piece

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


MANTISSAS = np.arange(2**23, dtype=np.int32)


def binade(exponent):
    """Every float32 in [2**exponent, 2**(exponent + 1))."""
    return (MANTISSAS + ((exponent + 127) << 23)).view(np.float32)


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


def test_log32_holds_for_every_mantissa():
    log32 = over(numerics.log32)
    for exponent in (-126, -1, 0, 127):
        x = binade(exponent)
        x = x[x != 1]
        exact = np.log(x.astype(float))
        assert np.abs(log32(x) / exact - 1).max() < 2e-7, exponent


def test_exp32_has_a_relative_error_below_2e7_near_zero_and_never_vanishes(uniform):
    exp32 = over(numerics.exp32)
    near = uniform(-1, 0).astype(np.float32)
    assert np.abs(exp32(near) / np.exp(near.astype(float)) - 1).max() < 2e-7
    far = uniform(-87, 0).astype(np.float32)  # here the argument's rounding, half an ulp of 126, dominates
    assert np.abs(exp32(far) / np.exp(far.astype(float)) - 1).max() < 2e-7 + 126 * 2.0**-24
    below = np.array([-88, -1e4, -3e38, -np.inf], dtype=np.float32)
    assert (exp32(below) == np.float32(2.0**-126)).all()
    assert numerics.exp32(np.float32(0)) == 1


def test_exp32_holds_over_its_whole_range():
    """All float32 of some binades, and a grid with both neighbours of every point."""
    exp32 = over(numerics.exp32)
    grid = np.linspace(-87.3, 0, 2_000_000).astype(np.float32)
    grid = np.concatenate([grid, np.nextafter(grid, np.float32(0)), np.nextafter(grid, np.float32(-99))])
    for x in (-binade(-24), -binade(-1), -binade(0), -binade(5), grid):
        x = x[(x > -87.3) & (x <= 0)]
        exact = np.exp(x.astype(float))
        limit = 2e-7 + 2.0**-24 * 1.5 * np.abs(x)  # x log2(e), below 1.5 |x|, is rounded once
        assert (np.abs(exp32(x) / exact - 1) < limit).all()


def test_expm1_32_loses_nothing_near_zero():
    expm1_32 = over(numerics.expm1_32)
    for x in (-binade(-100), -binade(-24), -binade(-2), -binade(-1), -binade(0), -binade(3)):
        assert np.abs(expm1_32(x) / np.expm1(x.astype(float)) - 1).max() < 3e-7
    assert numerics.expm1_32(np.float32(0)) == 0
    assert numerics.expm1_32(np.float32(-1e30)) == -1


def test_cos_turns32_is_within_2e6_of_the_cosine(uniform):
    cos = over(numerics.cos_turns32)
    for width in (0.5, 3.0, 1e4):
        t = uniform(-width, width).astype(np.float32)
        assert np.abs(cos(t) - np.cos(2 * np.pi * t.astype(float))).max() < 2e-6


def test_tanh32_holds_for_every_mantissa():
    tanh32 = over(numerics.tanh32)
    for exponent in (-126, -12, -2, -1, 0, 3):
        x = binade(exponent)
        exact = np.tanh(x.astype(float))
        assert np.abs(tanh32(x) - exact).max() < 2e-7
        assert np.abs(tanh32(-x) + exact).max() < 2e-7


@numba.njit
def normal_pairs(low, high, out):
    for i in range(len(low)):
        out[0, i], out[1, i] = draws.normal_pair32((np.uint64(high[i]) << np.uint64(32)) | np.uint64(low[i]))
    return out


def test_normal_pair32_is_box_and_mullers_transform_for_all_angles_and_radii():
    some = np.append(np.arange(0, 2**24, 5, dtype=np.uint32), np.uint32(2**24 - 1))
    step = float(np.float32(9.3623573e-08))  # 3.4e-5 short of pi / 2**25: the last 5e-5 rad of a quadrant are not drawn
    assert abs(step * 2**25 / np.pi - 1) < 4e-5
    for low, high in ((np.full_like(some, 2**20), some), (some, np.full_like(some, 5_000_000))):
        got = normal_pairs(low, high, np.empty((2, len(some)), np.float32))
        u = (low.astype(np.float32) + np.float32(0.5)).astype(float) * 2.0**-24
        radius = np.sqrt(-2 * np.log(u))
        angle = (high + 0.5) * step
        for z, exact in zip(got, (radius * np.cos(angle), radius * np.sin(angle))):
            assert (np.abs(z - exact) <= 4e-7 * radius).all()


def test_normal_pair32_takes_its_signs_from_bits_of_their_own():
    high = np.arange(4, dtype=np.uint32) << np.uint32(24)
    pairs = normal_pairs(np.full(4, 9, np.uint32), high, np.empty((2, 4), np.float32))
    assert (np.sign(pairs.T) == [[1, 1], [-1, 1], [1, -1], [-1, -1]]).all()


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


def test_a_piece_keeps_its_rules_whoever_calls_it_first():
    @piece
    def product_and_sum(x):
        return x * x + x

    @numba.njit(fastmath=True)
    def caller(x):
        return product_and_sum(x)

    caller(1.5)
    assert "fmul double" in product_and_sum.inspect_llvm(product_and_sum.signatures[0])


@pytest.mark.parametrize("name", ["log", "exp"])
def test_regrouping_leaves_the_double_functions_within_four_ulp(name, uniform):
    function = over(fast(getattr(numerics, name)))
    for x in (uniform(0.01, 2), uniform(1, 700), 1 + uniform(-1e-9, 1e-9)):
        assert ulps(function(x), getattr(np, name)(x.astype(np.longdouble))).max() <= 4


def test_the_normal_distribution_function_is_scipys(uniform):
    normal_cdf = over(numerics.normal_cdf)
    for x in (uniform(-37, 9), uniform(-1, 1), uniform(-1e-9, 1e-9), np.array([-37.5, -0.0, 0.0, 40.0, 1e300])):
        np.testing.assert_allclose(normal_cdf(x), special.ndtr(x), rtol=1e-12)
    assert numerics.normal_cdf(0.0) == 0.5
    assert numerics.normal_cdf(-1e9) == numerics.normal_cdf(-np.inf) == 0 and numerics.normal_cdf(np.inf) == 1


@pytest.mark.parametrize("mode", ["strict", "fast"])
def test_its_logarithm_in_float32_is_scipys(mode, uniform):
    function = numerics.log_normal_cdf32 if mode == "strict" else fast(numerics.log_normal_cdf32)
    log_normal_cdf32 = over(function)
    grid = np.concatenate([-binade(e)[::7] for e in (-3, 0, 2, 4)] + [binade(e)[::7] for e in (-3, 0, 2)])
    for x in (uniform(-8, 8), uniform(-1e5, 0), uniform(-1e-3, 1e-3), grid):
        x = x.astype(np.float32)
        exact, got = special.log_ndtr(x.astype(float)), log_normal_cdf32(x)
        assert (np.abs(got - exact) <= 2e-7 + 4e-7 * np.abs(exact)).all()
        assert (got <= 0).all()
    far = log_normal_cdf32(np.array([-np.inf, -3e38, 3e38, np.inf], np.float32))
    assert (far[:2] < -1e29).all() and np.isfinite(far).all() and (far[2:] == 0).all()


def test_expected_error_is_the_mean_length_of_a_normal_vector():
    from scipy.special import ellipe

    from wsn_env.compiled.elementary import expected_error

    for minor in np.linspace(0, 1, 21):
        exact = np.sqrt(2 / np.pi) * ellipe(1 - minor**2)
        turned = np.array([[0.8, -0.6], [0.6, 0.8]])
        cov = 9.0 * turned @ np.diag([1.0, minor**2]) @ turned.T
        assert expected_error(cov[0, 0], cov[0, 1], cov[1, 1]) == pytest.approx(3 * exact, rel=2e-3)
