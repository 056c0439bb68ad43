"""The package `particles` (Chopin & Papaspiliopoulos, 2020): a bootstrap filter of a state-space model."""

import numpy as np
import particles
from particles import distributions
from particles.collectors import Moments
from particles.state_space_models import Bootstrap, StateSpaceModel

from benchmarks.filters.implementation import Implementation
from benchmarks.filters.problem import PERIODS, Problem, constant_velocity


class Drawn(distributions.ProbDist):
    """A law that can only be drawn from; quicker than MvNormal, whose (4, 4) factor the noise does not need."""

    dim = 4

    def __init__(self, draw):
        self.draw = draw

    def rvs(self, size=None):
        """(P, 4)."""
        return self.draw()


class Flat(distributions.ProbDist):
    """The law of no report."""

    def __init__(self, count: int):
        self.count = count

    def logpdf(self, x):
        """(P,) zeros."""
        return np.zeros(self.count)


class Tracking(StateSpaceModel):
    """Constant velocity and the reports of a problem's only row; time 0 is the prior."""

    def __init__(self, problem: Problem, rng: np.random.Generator):
        super().__init__()
        self.problem, self.rng = problem, rng
        self.transition, self.gain = constant_velocity(problem.period_s)

    def PX0(self):
        """The prior cloud."""
        return Drawn(lambda: self.problem.particles[0].T.astype(float))

    def PX(self, t, xp):
        """F x + G a (eqs. 6, 8)."""
        p = self.problem
        return Drawn(lambda: xp @ self.transition.T + self.rng.normal(0, p.q, (p.count, 2)) @ self.gain.T)

    def PY(self, t, xp, x):
        """Independent reports (eqs. 7, 1)."""
        p = self.problem
        if t == 0:
            return Flat(p.count)
        if p.measurement == "position":
            laws = [distributions.Normal(loc=x[:, axis], scale=p.noise) for axis in (0, 2)] * p.values.shape[2]
            return distributions.IndepProd(*laws)
        expected = []
        for sensor in p.sensors[0, t - 1]:
            squared = (x[:, 0] - sensor[0]) ** 2 + (x[:, 2] - sensor[1]) ** 2
            expected.append(p.level - p.slope * np.log(np.maximum(squared, p.floor)))
        return distributions.IndepProd(*(distributions.Normal(loc=loc, scale=p.noise) for loc in expected))


def moments(weights, x) -> tuple[np.ndarray, np.ndarray]:
    """Mean (4,) and covariance (4, 4); the package's own are coordinate by coordinate."""
    mean = weights @ x
    deviation = x - mean
    return mean, (deviation * weights[:, None]).T @ deviation


class Particles(Implementation):
    """SMC, resampling (at the start of the next step) with its systematic scheme."""

    package = "particles"

    def restart(self) -> None:
        """A new run, after its time 0."""
        p = self.problem
        reports = p.values[0].reshape(PERIODS, -1) if p.measurement == "position" else p.values[0, :, :, 0]
        data = [None, *reports[:, None, :]]
        model = Tracking(p, np.random.default_rng(p.seed))
        self.run = particles.SMC(
            fk=Bootstrap(ssm=model, data=data),
            N=p.count,
            resampling="systematic",
            ESSrmin=1.0 if p.resampling else 0.0,
            collect=[Moments(mom_func=moments)],
        )
        next(self.run)

    def advance(self, period: int) -> None:
        """One iteration."""
        next(self.run)

    def estimate(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """As collected."""
        mean, cov = self.run.summaries.moments[-1]
        return mean[None], cov[None], np.array([self.run.wgts.ESS])
