"""Two ways to the width of a fingerprint network: golden section, and the fruit fly optimisation of Pan (2012)."""

from collections.abc import Callable

import numpy as np

GOLDEN = (5**0.5 - 1) / 2


def golden_section(
    error: Callable[[float], float], low: float = 0.2, high: float = 20.0, evaluations: int = 16
) -> tuple[float, float]:
    """The width with the least error between two bounds, by golden section in its logarithm.

    Kiefer (1953). The error must fall and then rise: with the width the network goes from the nearest fingerprint to
    the mean of all, and its error does so.

    Returns: width, its error.
    """
    a, b = np.log(low), np.log(high)
    c, d = b - GOLDEN * (b - a), a + GOLDEN * (b - a)
    at_c, at_d = error(np.exp(c)), error(np.exp(d))
    for _ in range(evaluations - 2):
        if at_c < at_d:
            b, d, at_d = d, c, at_c
            c = b - GOLDEN * (b - a)
            at_c = error(np.exp(c))
        else:
            a, c, at_c = c, d, at_d
            d = a + GOLDEN * (b - a)
            at_d = error(np.exp(d))
    best, least = (c, at_c) if at_c < at_d else (d, at_d)
    return float(np.exp(best)), float(least)


def fruit_flies(
    error: Callable[[float], float],
    rng: np.random.Generator,
    low: float = 0.05,
    high: float = 30.0,
    population: int = 10,
    iterations: int = 20,
    step: float = 1.0,
) -> tuple[float, float]:
    """The width with the least error that a swarm of fruit flies finds.

    Every fly leaves the swarm's place (X, Y) for a random point nearby and smells there the error of the width
    1 / sqrt(X^2 + Y^2), cut off at the bounds. The swarm moves to the best fly when that beats the best so far. Pan
    (2012); the step shrinks as step (1 - n / iterations), and as the best is kept, no evaluation is lost.

    Returns: width, its error, after population * iterations evaluations.
    """
    place = rng.uniform(0.0, 1.0, 2)
    best, least = np.nan, np.inf
    for n in range(iterations):
        reach = step * (1 - n / iterations)
        flies = place + rng.uniform(-reach, reach, (population, 2))
        widths = np.clip(1 / (np.hypot(*flies.T) + 1e-12), low, high)
        errors = [error(width) for width in widths]
        leader = int(np.argmin(errors))
        if errors[leader] < least:
            best, least, place = widths[leader], errors[leader], flies[leader]
    return float(best), float(least)
