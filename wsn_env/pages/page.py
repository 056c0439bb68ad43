"""Templates filled in: one file of HTML with everything that it needs inside."""

from __future__ import annotations

import html
import json
import re
from importlib.resources import files


def template(name: str) -> str:
    """The text of a file of `templates/`."""
    return (files("wsn_env.pages") / "templates" / name).read_text(encoding="utf-8")


def filled(name: str, **parts: str) -> str:
    """A template, each {{part}} replaced by its HTML. What is put in is not looked at again."""
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], template(name))


def whole_page(kind: str, title: str, body: str) -> str:
    """A page with our style.

    Args:
        kind: "replay" or "report".
        title: plain text.
        body: HTML.
    """
    return filled("page.html", kind=kind, title=html.escape(title), style=template("style.css"), body=body)


def script_safe(data) -> str:
    """JSON that cannot end the script element that it stands in."""
    return json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
