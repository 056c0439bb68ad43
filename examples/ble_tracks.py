"""Real motion: the tracks of the public "Position-Annotated BLE RSSI" dataset as CSV files of t, x, y.

    python examples/ble_tracks.py --data FOLDER --out tracks
    python -m wsn_env evaluate --tracks tracks/*.csv --policies pre_dc nearest1

Danis, Naskali, Cemgil & Ersoy, "An indoor localization dataset and data collection framework with high precision
position annotation", Pervasive and Mobile Computing 81, 2022. Only the positions are read here; lines are
timestamp [s], receiver, beacon, RSSI [dBm], x, y, z [m], orientation.
"""

import csv
import sys
from dataclasses import dataclass
from pathlib import Path

import tyro


@dataclass
class Convert:
    """Turn every *.mbd file of the dataset into a track."""

    data: Path
    """Folder with the downloaded *.mbd files."""
    out: Path
    """Folder for the CSV files."""


def positions(path: Path) -> list[tuple[float, float, float]]:
    """(t, x, y) in order of time, one a timestamp; t counts from the first."""
    points = {}
    with open(path, newline="") as file:
        for number, line in enumerate(csv.reader(file), 1):
            try:
                points[float(line[0])] = float(line[4]), float(line[5])
            except (ValueError, IndexError):
                raise ValueError(
                    f"{path}, line {number}: must be timestamp, receiver, beacon, RSSI, x, y, ..."
                ) from None
    first = min(points)
    return [(t - first, *points[t]) for t in sorted(points)]


def main() -> int:
    """Convert; bad input is one line on stderr."""
    settings = tyro.cli(Convert, description=__doc__)
    try:
        files = sorted(settings.data.glob("*.mbd"))
        if not files:
            raise ValueError(f"{settings.data} holds no *.mbd file")
        settings.out.mkdir(parents=True, exist_ok=True)
        for path in files:
            track = positions(path)
            with open(settings.out / f"{path.stem}.csv", "w", newline="") as file:
                csv.writer(file).writerows([("t", "x", "y"), *track])
            print(f"{path.stem}: {len(track)} positions in {track[-1][0]:.0f} s")
    except ValueError as problem:
        print(f"ble_tracks.py: {problem}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
