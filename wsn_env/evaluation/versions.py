"""What made a result: the packages' versions, and this package's sources."""

from __future__ import annotations

import hashlib
import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from pathlib import Path

SOURCES = (".py", ".json", ".safetensors")


def versions() -> dict[str, str]:
    """By package."""
    found = {"python": platform.python_version()}
    for name in ("wsn_env", "numpy", "numba", "gymnasium", "filterpy", "scipy", "stable-baselines3", "torch"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            pass
    return found


@cache
def sources_digest() -> str:
    """Of every source file of the package, tuned number and trained policy, wherever it is installed: any may have
    changed what a result says."""
    folders = [Path(str(files(name))) for name in ("wsn_env", "wsn_env.agents")]
    paths = {path.resolve() for folder in folders for path in folder.rglob("*") if path.suffix in SOURCES}
    digests = sorted(hashlib.sha256(path.read_bytes()).digest() for path in paths)
    return hashlib.sha256(b"".join(digests)).hexdigest()
