"""Where copies go: the improved resampling against its formulas, and what a handover redraws."""

import numba
import numpy as np
import pytest

from tests.test_particle import Filter
from wsn_env import Cluster, Scenario, World
from wsn_env.compiled import draws
from wsn_env.compiled.kernels import fast
from wsn_env.filters import kernels, resampling
from wsn_env.models.state import belief_at

COV = np.array([[4.0, 0.6, 1.0, 0.1], [0.6, 0.3, 0.2, 0.0], [1.0, 0.2, 2.0, -0.4], [0.1, 0.0, -0.4, 0.5]])


def spreader(spread_copies):
    @numba.njit
    def spread(key, ancestors, scale, cov, x):
        spread_copies(draws.stream(np.uint64(key), 1, draws.SPREAD), ancestors, scale, cov, x)
        return x

    return spread


spread = spreader(resampling.spread_copies)


def spreader_alike(spread_copies_alike):
    @numba.njit
    def spread(ancestors, scale, cov, x):
        spread_copies_alike(ancestors, scale, cov, x)
        return x

    return spread


spread_alike = spreader_alike(resampling.spread_copies_alike)


def copies(counts):
    """Ancestors (P,) of parents that are copied so many times each."""
    return np.repeat(np.arange(len(counts), dtype=np.int32), counts)


def offsets(counts, key=0, cov=COV, scale=0.5):
    """(P, 4) where the copies of parents at the origin go."""
    ancestors = copies(counts)
    return spread(key, ancestors, scale, cov, np.zeros((4, len(ancestors)), np.float32)).T.astype(float)


@pytest.mark.parametrize("n", range(1, 12))
def test_n_copies_lie_in_pairs_along_one_direction(n):
    places = offsets([n])
    m, odd = n // 2, n % 2 == 1
    steps = np.arange(1, m + 1) if odd else np.arange(1, m)
    assert (places != 0).any(axis=1).sum() == 2 * len(steps)  # 2n copies bring 2 (n - 1) new ones
    np.testing.assert_allclose(places.sum(axis=0), 0, atol=1e-5)  # the mean stays
    if len(steps) == 0:
        return
    first = places[np.linalg.norm(places, axis=1).argsort()][n - 2 * len(steps)]  # the nearest that is no original
    along = places @ first / (first @ first)
    np.testing.assert_allclose(places, np.outer(along, first), atol=1e-5)
    np.testing.assert_allclose(np.sort(along), np.sort([*steps, *-steps, *[0] * (1 if odd else 2)]), atol=1e-5)
    factor = m * (m + 1) / 3 if odd else (m - 1) * (2 * m - 1) / 6
    assert (along**2).mean() == pytest.approx(factor, rel=1e-5)


@pytest.mark.parametrize("scale", [0.5, 2.0])
def test_directions_are_drawn_for_each_parent_from_the_clouds_covariance(scale):
    parents = 40_000
    sides = offsets([3] * parents, scale=scale).reshape(parents, 3, 4)
    pairs = sides[:, 1:] if (sides[0, 0] == 0).all() else sides[:, ::2]
    np.testing.assert_array_equal(pairs[:, 0], -pairs[:, 1])
    directions = pairs[:, 0] / scale
    doubt = np.sqrt((np.outer(np.diag(COV), np.diag(COV)) + COV**2) / parents)
    assert (np.abs(np.cov(directions.T) - COV) < 4 * doubt).all()
    assert (np.abs(directions.mean(axis=0)) < 4 * np.sqrt(np.diag(COV) / parents)).all()
    assert (np.abs(np.corrcoef(directions[1:, 0], directions[:-1, 0])[0, 1])) < 4 / parents**0.5


def test_a_parents_direction_does_not_depend_on_the_others():
    alone, crowd = offsets([1, 1, 5]), offsets([4, 7, 5])
    np.testing.assert_array_equal(alone[-5:], crowd[-5:])
    assert (offsets([1, 1, 5], key=1)[-5:] != alone[-5:]).any()


def test_a_common_spread_moves_all_parents_copies_by_the_clouds_sds():
    counts = [1, 2, 3, 4, 7, 8]
    ancestors = copies(counts)
    places = spread_alike(ancestors, 0.5, COV, np.zeros((4, len(ancestors)), np.float32)).T
    steps = places / (0.5 * np.sqrt(np.diag(COV)))
    np.testing.assert_allclose(steps, steps[:, :1] * np.ones(4), atol=1e-6)  # parallel lines
    for parent, n in enumerate(counts):
        own = np.sort(steps[ancestors == parent, 0])
        pairs = (n - 1) // 2
        np.testing.assert_allclose(own, np.sort([*[0] * (n - 2 * pairs), *range(1, pairs + 1), *range(-pairs, 0)]))


@pytest.mark.interpreted
def test_a_filter_spreads_alike():
    """The same copies as with systematic resampling, each moved along the sds of the cloud before."""
    chosen = dict(particles=500, filter_q=0.0, resample_below=1, noise_m=0.5)
    plain, alike = Filter(**chosen), Filter(**chosen, resampling="common_spread")
    for filter in (plain, alike):
        filter.step([(0, 49.5, 49.0)])
    np.testing.assert_array_equal(plain.belief.mean, alike.belief.mean)
    before, after = (f.belief.particles[0].T.astype(float) for f in (plain, alike))
    steps = (after - before) / (0.5 * np.sqrt(np.diag(plain.belief.cov[0])))
    np.testing.assert_allclose(steps, np.round(steps[:, :1]) * np.ones(4), atol=2e-2)
    assert len(np.unique(np.round(steps[:, 0]))) > 2


FLAT = [np.diag([1.0, 0, 4, 0]), np.zeros((4, 4)), np.ones((4, 4)), np.outer([1, 2, 3, 4], [1, 2, 3, 4])]


@pytest.mark.parametrize("cov", [COV, *FLAT])
def test_the_root_of_a_covariance(cov):
    @numba.njit
    def root(cov):
        return resampling.lower_root(cov)

    lower = np.zeros((4, 4))
    lower[np.tril_indices(4)] = root(np.asarray(cov, float))
    np.testing.assert_allclose(lower @ lower.T, cov, atol=1e-6 * max(1.0, np.abs(cov).max()))


@pytest.mark.interpreted
def test_estimates_are_read_before_and_the_mean_is_kept():
    """One period of both filters from the same cloud, without process noise."""
    reports = [(0, 49.5, 49.0)]
    chosen = dict(particles=500, filter_q=0.0, resample_below=1, noise_m=0.5)
    plain, spreading = Filter(**chosen), Filter(**chosen, resampling="spread")
    assert plain.step(reports).all() and spreading.step(reports).all()
    np.testing.assert_array_equal(plain.belief.mean, spreading.belief.mean)
    np.testing.assert_array_equal(plain.belief.cov, spreading.belief.cov)
    before, after = (f.belief.particles[0].astype(float) for f in (plain, spreading))
    np.testing.assert_allclose(after.mean(axis=1), before.mean(axis=1), atol=2e-5)
    assert (spreading.belief.log_weights == 0).all()
    distinct = [len(np.unique(cloud, axis=1).T) for cloud in (before, after)]
    assert distinct[1] > 1.3 * distinct[0]
    counts = np.unique(before, axis=1, return_counts=True)[1]
    assert distinct[1] == distinct[0] + (2 * ((counts - 1) // 2)).sum()


def test_spreading_widens_the_cloud_by_the_formulas_factor():
    """The added covariance is s^2 C times the mean of the factors: over many keys, for x."""
    ratios, expected = [], []
    for key in range(300):
        chosen = dict(particles=300, filter_q=0.0, resample_below=1, noise_m=0.5, key=key)
        plain, spreading = Filter(**chosen), Filter(**chosen, resampling="spread")
        for filter in (plain, spreading):
            filter.step([(0, 49.5, 49.0)])
        before, after = (f.belief.particles[0, 0].astype(float) for f in (plain, spreading))
        n = np.unique(before, return_counts=True)[1]
        factor = np.where(n % 2 == 1, (n // 2) * (n // 2 + 1) / 3, (n // 2 - 1) * (n - 1) / 6)
        ratios.append((after.var() - before.var()) / plain.belief.cov[0, 0, 0])
        expected.append(0.25 * (n * factor).sum() / len(before))
    doubt = np.std(np.subtract(ratios, expected), ddof=1) / 300**0.5
    assert abs(np.mean(ratios) - np.mean(expected)) < 4 * doubt
    assert np.mean(expected) > 10 * doubt  # or the line above could not fail


def test_fast_kernels_spread_alike():
    ancestors = copies([1, 2, 3, 4, 5, 11])
    x = np.random.default_rng(0).normal(50, 3, (4, len(ancestors))).astype(np.float32)
    strict = spread(3, ancestors, 0.5, COV, x.copy())
    quick = spreader(fast(resampling.spread_copies))(3, ancestors, 0.5, COV, x.copy())
    np.testing.assert_allclose(quick, strict, atol=2e-5)
    strict = spread_alike(ancestors, 0.5, COV, x.copy())
    quick = spreader_alike(fast(resampling.spread_copies_alike))(ancestors, 0.5, COV, x.copy())
    np.testing.assert_allclose(quick, strict, atol=2e-5)


def test_a_cloud_redrawn_has_the_mean_and_covariance_handed_over():
    @numba.njit
    def redraw(key, handle):
        kernels.redraw_row(np.uint64(key), 5, belief_at(handle), 0)

    filter = Filter(particles=40_000)
    belief = filter.belief
    belief.mean[:], belief.cov[:] = [300.0, -1.0, 20.0, 0.5], COV
    belief.log_weights[:] = -3
    redraw(7, belief.handle)
    cloud = belief.particles[0].T.astype(float)
    doubt = np.sqrt((np.outer(np.diag(COV), np.diag(COV)) + COV**2) / len(cloud))
    assert (np.abs(np.cov(cloud.T) - COV) < 4 * doubt).all()
    assert (np.abs(cloud.mean(axis=0) - belief.mean[0]) < 4 * np.sqrt(np.diag(COV) / len(cloud))).all()
    assert (belief.log_weights == 0).all()


@pytest.mark.interpreted
def test_particles_are_redrawn_at_a_handover_only():
    places = ((40, 50), (60, 50))
    chosen = dict(positions=places, particles=200, filter_q=0.0, radius_m=1e-3, search=False)  # nobody detects
    scenario = Scenario.named("PreDC-v0", **chosen)
    worlds = [World(s, threads=1) for s in (scenario, scenario.override(redraw_on_handover=True))]
    carried, redrawn = (world.reset([1]) for world in worlds)
    for head, same in ((0, True), (0, True), (1, False)):
        cluster = Cluster(np.array([head]), np.zeros((1, 0), int))
        carried, redrawn = (
            world.step(state, cluster)[0] for world, state in zip(worlds, (carried, redrawn), strict=True)
        )
        assert (carried.belief.particles == redrawn.belief.particles).all() == same
    assert np.isfinite(redrawn.belief.particles).all()
