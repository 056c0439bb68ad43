"""matplotlib figures to files and pages."""

from __future__ import annotations

import base64
import io
import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from wsn_env.evaluation.files import replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NEEDED = "pictures need matplotlib: pip install 'wsn_env[plot]'"


def can_draw() -> bool:
    """Whether matplotlib is there."""
    return find_spec("matplotlib") is not None


def _import_with_any_backend(backend: str) -> None:
    """matplotlib refuses to be imported where MPLBACKEND names none that it knows, although files need none."""
    del os.environ["MPLBACKEND"]
    import matplotlib

    with suppress(ValueError):
        matplotlib.rcParams["backend"] = os.environ["MPLBACKEND"] = backend


if can_draw() and os.environ.get("MPLBACKEND"):
    _import_with_any_backend(os.environ["MPLBACKEND"])


def escape_label(text: str) -> str:
    """A label that matplotlib shows as it is: dollars begin no formula, an underscore at the start hides nothing."""
    return (" " if text.startswith("_") else "") + text.replace("$", r"\$")


def write_picture(path: str | Path, figure: Figure, dpi: int = 140) -> None:
    """A figure as PNG, whole or not at all."""
    with replacing(path) as temporary, _missing_letters():
        figure.savefig(temporary, format="png", dpi=dpi)


@contextmanager
def _missing_letters() -> Iterator[None]:
    """matplotlib draws a box for a letter that its font lacks, such as an emoji in a label: no warning for each."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        yield


def svg_data_url(figure: Figure) -> str:
    """A figure as an SVG inside its own address, for the src of an image; the same figure gives the same text."""
    from matplotlib import rc_context

    written = io.StringIO()
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "wsn_env"}), _missing_letters():
        figure.savefig(written, format="svg", metadata={"Date": None})
    return "data:image/svg+xml;base64," + base64.b64encode(written.getvalue().encode()).decode()
