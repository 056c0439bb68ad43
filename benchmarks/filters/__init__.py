"""Particle filters of the field, one file each, on the same problem.

One filter step = constant velocity with white accelerations, weigh with the reports of m members, mean and covariance,
effective sample size, systematic resampling.
"""

from importlib import import_module

from benchmarks.filters.implementation import Absent, Implementation, Looped
from benchmarks.filters.problem import Problem

# By name: the module and its class. A module imports its peer, so that it is read only when it takes part.
IMPLEMENTATIONS = {
    "wsn_env, strict": ("ours", "Strict"),
    "wsn_env, fast": ("ours", "Fast"),
    "C, -O3 -march=native": ("reference", "Reference"),
    "C, -ffast-math": ("reference", "FastReference"),
    "NumPy f32, tuned": ("tuned", "Tuned"),
    "NumPy f64, textbook": ("textbook", "Textbook"),
    "filterpy's book": ("book", "Book"),
    "Stone Soup, m updates": ("stone_soup", "Updates"),
    "Stone Soup, one update": ("stone_soup", "Stacked"),
    "particles": ("particles_smc", "Particles"),
    "pfilter": ("pfilter_update", "PFilter"),
    "JAX, jit": ("jax_jit", "Jax"),
    "torch, eager": ("torch_filter", "Torch"),
    "torch, compiled": ("torch_filter", "Compiled"),
}
SLOW_STARTERS = frozenset(
    {"torch, compiled"}
)  # compile for seconds for every shape: short runs and grids leave them out


def kind_of(name: str) -> type[Implementation]:
    """The class of an implementation. Raises Absent if its package is not installed."""
    module, attribute = IMPLEMENTATIONS[name]
    try:
        return getattr(import_module(f"benchmarks.filters.{module}"), attribute)
    except ImportError as error:
        raise Absent(str(error)) from None


def enter(name: str, problem: Problem) -> Implementation:
    """An implementation at the start of a problem of any number of rows. Raises Absent if it cannot take part."""
    kind = kind_of(name)
    return kind(problem) if kind.batches or problem.rows == 1 else Looped(kind, problem)
