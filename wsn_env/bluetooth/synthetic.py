"""A small synthetic folder in the format of the public Bluetooth dataset.

    python -m wsn_env.bluetooth.synthetic DIR [--tracks 2] [--seconds 40] [--seed 0]

A beacon at 1.8 m walks from point to point; what it sends is heard with log-distance levels, noise and losses.
"""

import argparse
import json
from pathlib import Path

import numpy as np

ROOM_M = (20.66, 17.64)
LOW_M, HIGH_M, BEACON_M = 1.22, 2.30, 1.8  # heights: of four receivers, of eight, of the beacon
SHARES = (  # of the room, where receivers stand: four inside, eight along the walls
    *((0.33, 0.4), (0.33, 0.65), (0.67, 0.65), (0.67, 0.35)),
    *((0.33, 0.03), (0.03, 0.35), (0.03, 0.7), (0.33, 0.97), (0.67, 0.97), (0.9, 0.7), (0.9, 0.35), (0.67, 0.03)),
)
NAMES = tuple(f"{0x101 + number:012x}" for number in range(len(SHARES)))
BEACON = "beac0000e001"
START_S = 1.6e9  # the first timestamp
INTERVAL_S, LOSS = 0.4525, 0.15
SPEED_MS = 0.5
EXPONENT, NOISE_DB = 1.7, 5.0
ORIENTATION = "0.0,0.0,-1.0,1.0,0.0,0.0,0.0,-1.0,0.0"


def write_dataset(folder: str | Path, tracks: int = 2, seconds: float = 40, seed: int = 0) -> Path:
    """Write tetam.dev, tetam.par and walk_0_all_sensors.mbd, walk_1...; returns the folder."""
    folder, rng = Path(folder), np.random.default_rng(seed)
    folder.mkdir(parents=True, exist_ok=True)
    places = receiver_positions()
    dongles = {
        name: [place, number, f"sensor{number}"] for number, (name, place) in enumerate(zip(NAMES, places.tolist()))
    }
    beacons = {BEACON: [[], 1328790, "beacon1"]}
    (folder / "tetam.dev").write_text(
        f"Dongles:{json.dumps(dongles)}\nBeacons:{json.dumps(beacons)}\n", encoding="utf-8"
    )
    (folder / "tetam.par").write_text(
        json.dumps({"origin": [22, 9], "limits": [0.0, 0.0, *ROOM_M], "parity": 0.0296}), encoding="utf-8"
    )
    at_1m = rng.normal(-59, 3, len(places))
    for track in range(tracks):
        lines = packet_lines(rng, places, at_1m, START_S + 1000 * track, seconds)
        (folder / f"walk_{track}_all_sensors.mbd").write_text("".join(lines), encoding="utf-8")
    return folder


def receiver_positions() -> np.ndarray:
    """(12, 3) m."""
    heights = np.array([LOW_M] * 4 + [HIGH_M] * 8)
    return np.column_stack([SHARES * np.array(ROOM_M), heights]).round(2)


def packet_lines(
    rng: np.random.Generator, places: np.ndarray, at_1m: np.ndarray, start_s: float, seconds: float
) -> list[str]:
    """The packets of a walk, in the order of time."""
    time = np.arange(0, seconds, INTERVAL_S)
    position = walk(rng, time)
    lines = []
    for sent, here in zip(time, position):
        distance = np.linalg.norm(here - places, axis=1)
        level = np.round(at_1m - 10 * EXPONENT * np.log10(distance) + rng.normal(0, NOISE_DB, len(places)))
        written_s = start_s + sent + rng.uniform(0, 3e-3, len(places))  # each receiver has its delay
        for receiver in range(len(places)):
            if rng.random() >= LOSS:
                x, y, z = here
                lines.append(
                    f"{written_s[receiver]:.7f},{NAMES[receiver]},{BEACON},{level[receiver]:.0f},"
                    f"{x:.3f},{y:.3f},{z:.3f},{ORIENTATION}\n"
                )
    return sorted(lines)


def walk(rng: np.random.Generator, time: np.ndarray) -> np.ndarray:
    """Positions (N, 3) m on straight ways between random points, 1 m or more from the walls."""
    corners = rng.uniform(1, np.array(ROOM_M) - 1, (2 + int(time[-1]), 2))
    way = np.append(0, np.cumsum(np.hypot(*np.diff(corners, axis=0).T)))
    x, y = (np.interp(SPEED_MS * time, way, values) for values in corners.T)
    return np.column_stack([x, y, np.full(len(time), BEACON_M)])


def main() -> None:
    """Write a folder."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, metavar="DIR")
    parser.add_argument("--tracks", type=int, default=2)
    parser.add_argument("--seconds", type=float, default=40)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    write_dataset(arguments.folder, arguments.tracks, arguments.seconds, arguments.seed)


if __name__ == "__main__":
    main()
