"""Real motion: the tracks of the public Bluetooth dataset (WSN_BLE_DIR names its folder), and a file like them."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from examples.ble_tracks import positions
from wsn_env import Scenario, World, evaluate
from wsn_env.bluetooth.synthetic import write_dataset
from wsn_env.models.recordings.dataset import read_dataset

FOLDER = os.environ.get("WSN_BLE_DIR")
SCRIPT = Path(__file__).parents[1] / "examples" / "ble_tracks.py"
needs_tracks = pytest.mark.skipif(not FOLDER, reason="WSN_BLE_DIR is not set")


def convert(data, out):
    return subprocess.run(
        [sys.executable, str(SCRIPT), "--data", str(data), "--out", str(out)], capture_output=True, text=True
    )


def test_a_folder_becomes_tracks_in_order_of_time(tmp_path):
    write_dataset(tmp_path, tracks=2, seconds=20)
    track = read_dataset(tmp_path)[0]
    points = positions(track)
    assert points[0][0] == 0.0 and all(a[0] < b[0] for a, b in zip(points, points[1:]))
    assert len(points) == len(np.unique(track.time_s))
    assert convert(tmp_path, tmp_path / "out").returncode == 0
    file = str(tmp_path / "out" / "walk_0.csv")
    scenario = Scenario.named("PreDC-v0", motion="recorded", tracks=(file,), periods=40)
    drawn = World(scenario).reset([1]).track[0]
    assert np.allclose(np.ptp(drawn[:, ::2], axis=0).max(), 80, atol=1)  # scaled
    shape = track.position_m[:, :2] - track.position_m[0, :2]
    scale = 80 / np.ptp(shape, axis=0).max()
    assert np.allclose(drawn[-1, ::2] - drawn[0, ::2], scale * shape[-1], atol=0.1)
    answer = convert(tmp_path / "out", tmp_path / "out")
    assert answer.returncode == 2 and answer.stderr.startswith("ble_tracks.py: ")


@needs_tracks
def test_recorded_tracks_are_followed(tmp_path):
    """All six stay in the field, are drawn by the key, and Pre-DC seldom loses the target."""
    assert convert(FOLDER, tmp_path).returncode == 0
    tracks = sorted(map(str, tmp_path.glob("*.csv")))
    assert len(tracks) == 6
    scenario = Scenario.named("PreDC-v0", motion="recorded", tracks=tuple(tracks), particles=1000)
    assert scenario.filter_q == 0.2
    drawn = World(scenario).reset(range(200)).track
    assert len(np.unique(drawn[:, 0], axis=0)) == 6
    extent = np.ptp(drawn[:, :, ::2], axis=1).max(axis=1)
    assert drawn[:, :, ::2].min() >= 0 and drawn[:, :, ::2].max() <= 100 and np.allclose(extent, 80, atol=1)
    evaluation = evaluate(["pre_dc"], scenario, [4.0], episodes=100)
    assert evaluation.values("pre_dc", 4.0, "rms_m").mean() < 4.0
    assert evaluation.values("pre_dc", 4.0, "lost").mean() < 5.0
