"""Reading a recorded Bluetooth track: a file of 600 kB in under a second, beside csv and NumPy.

    python -m benchmarks.recording [--rounds N] [--short] [--json FILE]

The implementations split lines and make numbers of the fields that are needed; the loader also judges every line, sorts
the packets, and counts what it leaves out.
"""

import csv
import tempfile
from pathlib import Path

import numpy as np
from rich.console import Console

from benchmarks.race import Claim, Options, Result, Table, figure, interleave, main
from wsn_env.bluetooth.synthetic import write_dataset
from wsn_env.models.recordings.dataset import read_track, track_files
from wsn_env.models.recordings.receivers import read_receivers

SECONDS, SHORT_SECONDS = 256, 30  # of a track; the first makes 600 kB
AT_MOST_S = 1.0
NEEDED = (0, 3, 4, 5, 6)  # time, level, x, y, z


def by_csv(path: Path) -> np.ndarray:
    """(N, 5) by the standard library."""
    with open(path, newline="", encoding="utf-8") as file:
        return np.array([[float(row[k]) for k in NEEDED] for row in csv.reader(file)])


def by_numpy(path: Path) -> np.ndarray:
    """(N, 5) by NumPy."""
    return np.loadtxt(path, delimiter=",", usecols=NEEDED)


def measure(options: Options, console: Console) -> Result:
    """Write a track, check that all read the same, race."""
    with tempfile.TemporaryDirectory() as folder:
        write_dataset(folder, tracks=1, seconds=SHORT_SECONDS if options.short else SECONDS)
        path, receivers = track_files(folder)[0], read_receivers(folder)
        console.print(f"recording, {path.stat().st_size / 1000:.0f} kB", style="dim")
        calls = {
            "read_track": lambda: read_track(path, receivers),
            "csv and float": lambda: by_csv(path),
            "numpy.loadtxt": lambda: by_numpy(path),
        }
        check_same_values(calls)
        times = interleave(calls, options)
        kilobytes = path.stat().st_size / 1000
    lines = [[name, figure(1000 * times.median(name)), figure(kilobytes / 1000 / times.median(name))] for name in calls]
    return Result(
        name="recording",
        title="Reading a recorded track",
        text=f"A synthetic Bluetooth track of {kilobytes:.0f} kB in the published format. The implementations make"
        " numbers of the fields needed and look at nothing else.",
        claims=[
            Claim("reading a recorded track", AT_MOST_S, times.median("read_track"), unit="s", at_most=True),
            Claim("the same over csv and float", 4.0, times.ratio("read_track", "csv and float"), at_most=True),
        ],
        tables=[Table("Time on one core", ["reader", "ms", "MB/s"], lines)],
        packages=["numpy"],
    )


def check_same_values(calls) -> None:
    """Raise unless all give the same times and levels."""
    track = calls["read_track"]()
    for name in ("csv and float", "numpy.loadtxt"):
        rows = calls[name]()
        rows = rows[np.argsort(rows[:, 0], kind="stable")]
        if len(rows) != len(track.time_s) or not np.array_equal(np.sort(rows[:, 1]), np.sort(track.level_db)):
            raise SystemExit(f"{name} and read_track do not read the same levels")


if __name__ == "__main__":
    main(measure, __doc__)
