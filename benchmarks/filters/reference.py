"""The algorithm of wsn_env's filter in C, compiled on the spot: same random numbers, polynomials, lanes, resampler."""

import ctypes
import functools
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.filters.implementation import Absent, Implementation
from benchmarks.filters.problem import MEMBERS, PERIODS, Problem
from wsn_env.compiled import draws
from wsn_env.filters.resampling import REACH

SOURCE = Path(__file__).with_name("reference.c")
# Neither errno nor traps are results, and without them gcc uses vectors throughout.
STRICT_FLAGS = ("-O3", "-march=native", "-fno-math-errno", "-fno-trapping-math")


class Model(ctypes.Structure):
    """`struct model` of the C file."""

    _fields_ = [
        *((name, ctypes.c_double) for name in ("period_s", "q", "noise", "level", "slope", "floor", "resample_below")),
        *((name, ctypes.c_int64) for name in ("strength", "members", "process", "resampling")),
    ]


@functools.cache
def compiled(flags: tuple[str, ...]) -> ctypes.CDLL:
    """The shared library. Raises Absent where there is no C compiler or it refuses."""
    compiler = shutil.which("cc")
    if compiler is None:
        raise Absent("no C compiler cc")
    with tempfile.TemporaryDirectory() as folder:
        object_file, library = Path(folder) / "reference.o", Path(folder) / "reference.so"
        for command in (
            [compiler, "-std=gnu11", "-c", "-fPIC", *flags, "-o", object_file, SOURCE],
            # Apart, without the flags: linked with -ffast-math, a library turns denormals off in the whole process.
            [compiler, "-shared", "-o", library, object_file, "-lm"],
        ):
            done = subprocess.run(command, capture_output=True, text=True)
            if done.returncode:
                raise Absent(f"cc failed: {done.stderr.strip().partition(chr(10))[0]}")
        return ctypes.CDLL(str(library))


def _pointer(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


class Reference(Implementation):
    """As fast as C becomes without changing results by reordering; products may be fused with sums."""

    batches = True
    flags = STRICT_FLAGS

    def __init__(self, problem: Problem):
        rows, count = problem.rows, problem.count
        self.model = Model(
            problem.period_s,
            problem.q,
            problem.noise,
            problem.level,
            problem.slope,
            problem.floor,
            float(problem.resampling),
            problem.measurement == "rssi",
            MEMBERS,
            draws.PROCESS,
            draws.RESAMPLING,
        )
        self.particles = np.empty((rows, 4, count), np.float32)
        self.log_weights = np.empty((rows, count), np.float32)
        self.mean, self.cov, self.n_eff = np.empty((rows, 4)), np.empty((rows, 4, 4)), np.empty(rows)
        self.reports = [np.moveaxis(array, 1, 0).copy() for array in (problem.sensors, problem.values)]
        self.scratch = (
            np.empty(count, np.float32),
            np.zeros((3, count + REACH), np.int32),
            np.empty((2, count, 4), np.float32),
        )
        arrays = (self.particles, self.log_weights, self.mean, self.cov, self.n_eff, *self.scratch)
        rest = [_pointer(array) for array in arrays]
        size = ctypes.c_int64(rows), ctypes.c_int64(count), ctypes.byref(self.model)
        self.arguments = [
            (
                *size,
                ctypes.c_int64(k + 1),
                _pointer(problem.keys),
                *(_pointer(array[k]) for array in self.reports),
                *rest,
            )
            for k in range(PERIODS)
        ]
        self.call = compiled(self.flags).filter_rows
        super().__init__(problem)

    def restart(self) -> None:
        """`mean` is also the point about which the sums run."""
        self.particles[:] = self.problem.particles
        self.log_weights[:] = 0.0
        self.mean[:] = self.problem.prior_mean

    def advance(self, period: int) -> None:
        """One call."""
        self.call(*self.arguments[period])

    def estimate(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """As the C function wrote them."""
        return self.mean, self.cov, self.n_eff


class FastReference(Reference):
    """Sums and products in any order."""

    flags = ("-O3", "-march=native", "-ffast-math")


class ExactReference(Reference):
    """Nothing fused: the bits of wsn_env's strict kernel."""

    flags = (*STRICT_FLAGS, "-ffp-contract=off")
