"""The bound: its information by quadrature, the linear case by algebra, and a filter that tries to beat it."""

import math

import numpy as np
import pytest
from numba import njit

from studies import bound as study
from wsn_env import Scenario, World, make_policy
from wsn_env.evaluation.intervals import Measured
from wsn_env.evaluation.rollout import episodes, evaluation_seeds
from wsn_env.models.detection.base import information
from wsn_env.scenario.constants import constants
from wsn_env.simulation.bound import Bound, why_no_bound


@njit
def information_at(cs, distance):
    return information(cs[0].detection, cs[0].measurement, distance)


FREE = dict(motion="free", search=False, particles=50)


def played(scenario, policy, count=50):
    bound = Bound(scenario, threads=1)
    world, seeds = World(scenario, threads=1), evaluation_seeds(4, count)
    for state, outcome in episodes(make_policy(policy, scenario), world, seeds, lambda s, _: bound.begin(s)):
        bound.advance(state, outcome)
    return bound


def test_where_all_is_linear_it_is_the_kalman_filters_variance():
    """Every node hears everything: the covariance of the filter that knows the start's law, by its information form."""
    scenario = Scenario.named("PreDC-v0", **FREE, periods=30, radius_m=1000.0, ceiling=1.0)
    found = played(scenario, "nearest3").per_period_m()
    f, g = np.array([[1.0, 1.0], [0.0, 1.0]]), np.array([[0.5], [1.0]])
    j = np.diag([1 / 1.0**2 + 1 / 8.0**2, 1 / 0.1**2 + 1 / 0.15**2])
    for k in range(30):
        j = np.linalg.inv(f @ np.linalg.inv(j) @ f.T + 0.025**2 * g @ g.T)
        j[0, 0] += 4 / 2.0**2
        assert found[k] == pytest.approx(math.sqrt(2 * np.linalg.inv(j)[0, 0]), rel=1e-9)


@pytest.mark.parametrize("distance", [3.0, 8.3, 9.5, 11.0])
def test_the_information_of_detecting(distance):
    """p'^2 / (p (1 - p)) by eqs. 2-3, differentiated by hand."""
    share, along = information_at(constants(Scenario.named("PreDC-v0")), distance)
    a1, a2 = distance - 8.0, 12.0 - distance
    p = 0.6 * math.exp(-(a1**3) / a2**2) if a1 > 0 else 0.6
    slope = -p * (3 * a1**2 / a2**2 + 2 * a1**3 / a2**3) if a1 > 0 else 0.0
    assert share == pytest.approx(p, rel=1e-9) and along == pytest.approx(slope**2 / (p * (1 - p)), rel=1e-5)


@pytest.mark.parametrize("distance", [60.0, 150.0, 207.0, 320.0])
def test_the_information_of_a_level_that_is_heard_above_a_threshold(distance):
    """The mean square of the score in the mean level, by quadrature over the level and the silence."""
    scenario = Scenario.named("Underwater-v0")
    share, along = information_at(constants(scenario), distance)
    m = scenario.measurement
    a = (scenario.detection.threshold_db - m.mean_db(distance)) / m.noise_db
    u = np.linspace(a, a + 30, 300_001)
    density = np.exp(-(u**2) / 2) / math.sqrt(2 * math.pi)
    below = 0.5 * math.erfc(-a / math.sqrt(2))
    score = math.exp(-(a**2) / 2) / math.sqrt(2 * math.pi) / below
    assert share == pytest.approx(np.trapezoid(u**2 * density, u) + below * score**2, rel=1e-6) and along == 0.0


@pytest.mark.parametrize(
    ("overrides", "named"),
    [
        (dict(), None),
        (dict(motion="crossing"), "Scenario.motion = Crossing.*'free'"),
        (dict(measurement="binary"), "Scenario.measurement = Binary"),
        (dict(detection="unequal"), "Scenario.detection = UnequalRadii"),
        (dict(softness=1e-6), "Scenario.detection = Detection.*softer"),
        (dict(decay=0.0), "Scenario.detection = Detection.*softer"),
        (dict(start="search"), "Tracking.start = 'search'.*'known'"),
        (dict(search=True), "Tracking.search = True.*False"),
        (dict(ends_outside=True), "Scenario.ends_outside.*False"),
    ],
)
def test_only_where_its_suppositions_hold(overrides, named):
    scenario = Scenario.named("PreDC-v0", **(FREE | overrides))
    if named is None:
        assert why_no_bound(scenario) is None
    else:
        with pytest.raises(ValueError, match=named):
            Bound(scenario)


def test_none_once_a_node_has_died():
    """Who was awake is then not known any more, and counting too few would raise it above what filters reach."""
    with pytest.raises(ValueError, match="battery_j = 0.00015.*last"):
        played(Scenario.named("PreDC-v0", **FREE, periods=25, battery_j=1.5e-4), "nearest3")


def test_its_standard_error_is_that_of_blocks():
    """Of ten blocks of twenty episodes: about that of the mean of the blocks' own bounds, by a factor of two."""
    scenario = Scenario.named("PreDC-v0", **FREE, periods=20)
    bound, policy, parts = Bound(scenario, threads=1), make_policy("nearest3", scenario), []
    for block in range(10):
        both = bound, Bound(scenario, threads=1)
        seeds = evaluation_seeds(4, 200)[20 * block : 20 * block + 20]
        begin = lambda state, _, both=both: [one.begin(state) for one in both]  # noqa: E731
        for state, outcome in episodes(policy, World(scenario, threads=1), seeds, begin):
            for one in both:
                one.advance(state, outcome)
        parts.append(both[1].rms_m())
    apart = np.std(parts, ddof=1) / 10**0.5
    assert 0.5 * apart < bound.stderr_m() < 2 * apart


SHORT, LONG = ("PreDC-v0", "Anchors-v0"), [pytest.mark.slow, pytest.mark.full]


@pytest.mark.parametrize(
    ("name", "count", "particles"),
    [
        *(
            pytest.param(name, 8, 100_000, marks=[] if name in ("PreDC-v0", "Anchors-v0") else LONG)
            for name in study.FREE
        ),
        *(pytest.param(name, 2000, 5000, marks=LONG) for name in study.FREE),
    ],
)
def test_a_filter_that_is_given_all_laws_does_not_beat_it(name, count, particles):
    """Root mean square error over the bound: not below 1 by more than two standard errors."""
    short = {} if count > 1000 else dict(periods=20)
    scenario = study.make_scenario(name, (study.FREE[name] + " search=False").split(), [], **short)
    asked = study.Study([name], ["nearest3"], count, particles)
    found = study.compare("nearest3", scenario, asked, lambda *_: None)
    over, own = found.over_bound(), Measured.root_ratio(found.strong, found.own)
    assert over.value + 2 * over.stderr >= 1
    assert own.value < 1.05 + 2 * own.stderr  # and it is no weak one
