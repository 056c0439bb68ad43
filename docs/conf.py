"""Sphinx: `make docs` builds the site with warnings as errors.

Sphinx, MyST and furo, because they are kept, read the Markdown that is here, and make an API reference of docstrings.
Pictures of scenarios and policies (`docs/pictures.py`) and the scenarios' pages (`docs/scenarios.py`) are made anew in
every build, so that they show what is.
"""

import re
import sys
from dataclasses import fields, is_dataclass
from pathlib import Path

from docutils import nodes
from docutils.parsers.rst import Directive

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import pictures  # noqa: E402
import scenarios  # noqa: E402

from wsn_env import Scenario, __version__  # noqa: E402

project, author, release = "wsn_env", "the authors of wsn_env", __version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 3
html_theme, html_title = "furo", "wsn_env"
html_static_path = []
exclude_patterns = ["conf.py", "figures.py", "pictures.py", "reference_tables.py", "scenarios.py"]
autodoc_member_order = "bysource"
autodoc_typehints = "none"
nitpicky = False
suppress_warnings = ["myst.header", "misc.highlighting_failure"]


class Quantities(Directive):
    """A table of all quantities of a scenario: value, meaning, what is allowed."""

    required_arguments = 1

    def run(self):
        """The table."""
        scenario = Scenario.named(self.arguments[0])
        rows = []
        for item in fields(scenario):
            section = getattr(scenario, item.name)
            if is_dataclass(section):
                rows += [(type(section).__name__, part, getattr(section, part.name)) for part in fields(section)]
            else:
                rows.append(("Scenario", item, section))
        return [_table(("section", "quantity", "value", "meaning"), [_cells(*row) for row in rows])]


def _cells(section, part, value):
    text = repr(value) if not isinstance(value, tuple) or len(value) < 4 else f"{len(value)} values"
    return section, part.name, text, part.metadata.get("meaning", "")


def _table(header, rows):
    group = nodes.tgroup(cols=len(header))
    group += [nodes.colspec(colwidth=width) for width in (12, 22, 16, 60)]
    for kind, lines in ((nodes.thead(), [header]), (nodes.tbody(), rows)):
        for line in lines:
            row = nodes.row()
            for k, text in enumerate(line):
                words = nodes.literal(text=text) if k in (1, 2) and kind.tagname == "tbody" else nodes.Text(text)
                row += nodes.entry("", nodes.paragraph("", "", words))
            kind += row
        group += kind
    return nodes.table("", group)


SECTION = re.compile(r"(Args|Returns|Raises|Attributes|Yields):")


def markdown_to_rest(app, what, name, thing, options, lines):
    """Docstrings speak Markdown's few words: `code`, and code blocks by indentation."""
    if what in ("property", "attribute") and lines:  # napoleon would take what stands before a colon for a type
        lines[0] = lines[0].replace(": ", " – ", 1)
    out, section, block = [], False, False
    for line in lines:
        indented = line.startswith("    ")
        if line and not indented:
            section, block = bool(SECTION.match(line)), False
        if indented and not section and not block and out and not out[-1]:
            out += ["::", ""]
            block = True
        elif not indented and line and out and out[-1].startswith("    ") and not section:
            out.append("")
        words = re.sub(r"(?<!`)`([^`]+)`(?!`)", r"``\1``", line).replace(" *.", r" \*.")
        out.append(line if block and indented else words)
    lines[:] = out


def setup(app):
    """Sphinx's entry."""
    app.add_directive("quantities", Quantities)
    app.connect("autodoc-process-docstring", markdown_to_rest, priority=100)
    pictures.draw_all(HERE / "_generated")
    scenarios.write_pages(HERE / "_generated" / "scenarios")
