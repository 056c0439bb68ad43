"""Real motion: the tracks of the public "Position-Annotated BLE RSSI" dataset as CSV files of t, x, y.

    python examples/ble_tracks.py --data FOLDER --out tracks
    python -m wsn_env evaluate --tracks tracks/*.csv --policies pre_dc nearest1

Danis, Naskali, Cemgil & Ersoy, "An indoor localization dataset and data collection framework with high precision
position annotation", Pervasive and Mobile Computing 81, 2022. Only the positions are used here; docs/real_data.md
tells what else can be done with such a folder.
"""

import csv
import sys
from dataclasses import dataclass
from pathlib import Path

import tyro

from wsn_env.models.recordings.dataset import Track, read_dataset
from wsn_env.models.recordings.files import DatasetError


@dataclass
class Convert:
    """Turn every *.mbd file of the dataset into a track."""

    data: Path
    """Folder with the downloaded tetam.dev and *.mbd files."""
    out: Path
    """Folder for the CSV files."""


def positions(track: Track) -> list[tuple[float, float, float]]:
    """(t, x, y) in order of time, one a timestamp; t counts from the first."""
    return [(t, x, y) for t, (x, y) in dict(zip(track.time_s.tolist(), track.position_m[:, :2].tolist())).items()]


def main() -> int:
    """Convert; bad input is one line on stderr."""
    settings = tyro.cli(Convert, description=__doc__)
    try:
        tracks = read_dataset(settings.data)
        settings.out.mkdir(parents=True, exist_ok=True)
        for track in tracks:
            points = positions(track)
            with open(settings.out / f"{track.name}.csv", "w", newline="", encoding="utf-8") as file:
                csv.writer(file).writerows([("t", "x", "y"), *points])
            print(f"{track.name}: {len(points)} positions in {points[-1][0]:.0f} s")
    except (DatasetError, OSError) as problem:
        print(f"ble_tracks.py: {problem}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
