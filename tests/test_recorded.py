"""Real motion: the tracks of the public Bluetooth dataset (WSN_BLE_DIR names its folder), and a file like them."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from examples.ble_tracks import positions
from wsn_env import Scenario, World, evaluate

FOLDER = os.environ.get("WSN_BLE_DIR")
SCRIPT = Path(__file__).parents[1] / "examples" / "ble_tracks.py"
needs_tracks = pytest.mark.skipif(not FOLDER, reason="WSN_BLE_DIR is not set")


def convert(data, out):
    return subprocess.run(
        [sys.executable, str(SCRIPT), "--data", str(data), "--out", str(out)], capture_output=True, text=True
    )


def test_lines_become_a_track_in_order_of_time(tmp_path):
    packet = "{t},b827eb4521b4,e78f135624ce,-87,{x},{y},1.8,0,0,-1,1,0,0,0,-1,0\n"
    lines = [packet.format(t=t, x=x, y=y) for t, x, y in ((102.5, 3, 4), (100.0, 1, 2), (102.5, 3, 4), (101.0, 2, 2))]
    (tmp_path / "walk.mbd").write_text("".join(lines))
    assert positions(tmp_path / "walk.mbd") == [(0.0, 1.0, 2.0), (1.0, 2.0, 2.0), (2.5, 3.0, 4.0)]
    assert convert(tmp_path, tmp_path / "out").returncode == 0
    scenario = Scenario.named("PreDC-v0", motion="recorded", tracks=(str(tmp_path / "out" / "walk.csv"),), periods=5)
    track = World(scenario).reset([1]).track[0]
    assert np.allclose(track[[0, 2, 5], ::2], [[10, 10], [50, 10], [90, 90]])  # 2 m become 80, a point every 0.5 s
    (tmp_path / "walk.mbd").write_text("".join(lines) + "nonsense\n")
    answer = convert(tmp_path, tmp_path / "out")
    assert answer.returncode == 2 and "walk.mbd, line 5" in answer.stderr
    assert "holds no" in convert(tmp_path / "out", tmp_path / "out").stderr


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
