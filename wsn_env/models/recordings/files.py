"""Input files, read whole, and the numbers in them."""

from __future__ import annotations

import codecs
import json
import re
import stat
from collections import Counter
from pathlib import Path
from typing import Any

MOST_BYTES = 2**30  # of an input file: more than a week of packets at twelve receivers

_DATE = re.compile(r"\d[-/.]\d\d?[-/.]\d|\d:\d\d")


class DatasetError(ValueError):
    """A file cannot be used; the message names it, the line and what is wrong there."""


class DatasetWarning(UserWarning):
    """More than a tenth of a file is left out; the message names it, how much and why."""


def read_file(path: str | Path) -> bytes:
    """A file's bytes, without the mark of their order. What may never end (a pipe, a device) is not read.

    Raises:
        DatasetError: it cannot be read.
    """
    try:
        about = Path(path).stat()
        if stat.S_ISDIR(about.st_mode):
            raise ValueError("Is a directory")
        if not stat.S_ISREG(about.st_mode):
            raise ValueError("is a pipe or a device: must be a file")
        if about.st_size > MOST_BYTES:
            raise ValueError(f"has {about.st_size} bytes: at most {MOST_BYTES} are allowed")
        return Path(path).read_bytes().removeprefix(codecs.BOM_UTF8)
    except (OSError, ValueError) as problem:
        raise DatasetError(f"{path}: cannot be read: {getattr(problem, 'strerror', None) or problem}") from None


def read_text(path: str | Path) -> str:
    """The same as text.

    Raises:
        DatasetError: it cannot be read, or is no UTF-8.
    """
    try:
        return read_file(path).decode()
    except UnicodeDecodeError as problem:
        raise DatasetError(
            f"{path}: cannot be read: is no UTF-8 text ({problem.reason}, byte {problem.start})"
        ) from None


def parse_json(text: str | bytes) -> Any:
    """JSON whose tables name nothing twice.

    Raises:
        ValueError: what is wrong with it.
    """
    try:
        return json.loads(text, object_pairs_hook=_distinct)
    except RecursionError:
        raise ValueError("is nested too deep") from None


def _distinct(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        twice = next(name for name, times in Counter(name for name, _ in pairs).items() if times > 1)
        raise ValueError(f"{twice!r} is there twice")
    return table


def parse_number(text: str) -> float:
    """A number in the usual way of writing: no underscores, no digits but 0 to 9.

    Raises:
        ValueError: what is wrong with it.
    """
    try:
        if text.isascii() and "_" not in text:
            return float(text)
    except ValueError:
        pass
    raise ValueError(f"{shown(text)} is not a number" + (": a date must be given in seconds" if is_date(text) else ""))


def is_date(text: str) -> bool:
    """Whether a field looks like a date or the time of a clock."""
    return _DATE.search(text) is not None


def shown(text: str) -> str:
    """In a message: on one line, not too long."""
    return repr(text if len(text) <= 40 else text[:37] + "...")
