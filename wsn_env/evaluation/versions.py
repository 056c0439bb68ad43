"""What made a result: the packages' versions."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version


def versions() -> dict[str, str]:
    """By package."""
    found = {"python": platform.python_version()}
    for name in ("wsn_env", "numpy", "numba", "gymnasium", "filterpy", "scipy", "stable-baselines3", "torch"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            pass
    return found
