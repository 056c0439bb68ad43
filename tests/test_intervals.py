"""A measured figure and its standard error: by the delta method, by the bootstrap, as text."""

import numpy as np
import pytest

from wsn_env.evaluation.intervals import Measured


def test_a_ratio_and_its_error():
    rng = np.random.default_rng(1)
    under = rng.uniform(1, 2, 400)
    assert Measured.ratio(3 * under, under) == pytest.approx((3, 0), abs=1e-12)  # paired: no doubt is left
    draws = [Measured.ratio(rng.normal(6, 1, 100), rng.normal(2, 0.2, 100)) for _ in range(400)]
    assert np.std([share for share, _ in draws]) == pytest.approx(np.mean([error for _, error in draws]), rel=0.15)


def test_a_root_and_its_error():
    draws = [Measured.root_mean(np.random.default_rng(seed).normal(3, 1, 100) ** 2) for seed in range(400)]
    assert np.mean([root for root, _ in draws]) == pytest.approx(10**0.5, rel=0.01)
    assert np.std([root for root, _ in draws]) == pytest.approx(np.mean([error for _, error in draws]), rel=0.15)


def test_the_bootstrap_finds_the_error_of_a_mean():
    values = np.random.default_rng(1).normal(size=400)
    found = Measured.bootstrap(lambda runs: values[runs].mean(), 400)
    assert found.value == values.mean() and found.stderr == pytest.approx(Measured.mean(values).stderr, rel=0.2)


@pytest.mark.parametrize(
    ("value", "stderr", "text"),
    [
        (1.2345, 0.0412, "1.234 (0.041)"),
        (123.4, 27, "123 (27)"),
        (2, 0, "2"),
        (2, 1e-16, "2"),
        (2.5, float("nan"), "2.5"),
    ],
)
def test_its_text_shows_two_digits_of_the_error(value, stderr, text):
    assert str(Measured(value, stderr)) == text
