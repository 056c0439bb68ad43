"""The benchmarks' contestants compute the same thing. (Nothing here looks at a clock.)"""

import pytest

from benchmarks import environment
from benchmarks.filters.book import BookFilter
from benchmarks.filters.textbook import ParticleFilter


@pytest.mark.parametrize("kind", [ParticleFilter, BookFilter])
def test_naive_filters_equal_the_kernel(kind):
    assert environment.filter_difference(kind, periods=5, rows=2) < 1e-3


def test_with_noise_the_filters_agree_to_monte_carlo_accuracy():
    assert environment.filter_deviation(periods=8, rows=4) < 0.1


def test_the_naive_environment_has_the_same_episodes():
    differences = environment.episode_differences(12, 64, particles=500)
    assert set(differences) == {"rms_m", "energy_mj"}
    assert all(abs(value) < 3.0 for value in differences.values()), differences


def test_every_contestant_steps():
    for call, steps in environment.contestants().values():
        assert steps in (1, environment.ROWS)
        call()
