"""What is compared is the same, and every measurement runs. (Nothing here looks at a clock.)"""

from dataclasses import fields

import numpy as np
import pytest
from rich.console import Console

from benchmarks import episodes, frames, many_rows, memory, nodes, overhead, recording, training, vector, whole_training
from benchmarks.race import Options
from benchmarks.stopwatch import Stopwatch
from wsn_env.models.state import State

GLANCE = Options(rounds=1, short=True)
QUIET = Console(quiet=True)


def whole(result, claims: int):
    """Every claim is measured, every table complete."""
    assert len(result.claims) == claims
    assert all(claim.measured is not None and np.isfinite(claim.measured) for claim in result.claims)
    assert all(len(row) == len(table.columns) for table in result.tables for row in table.rows)
    assert all(value > 0 for plot in result.plots for line in plot.lines.values() for point in line for value in point)
    return result


def test_native_and_sync_give_the_same_bits():
    assert vector.count_equal_steps(particles=300, rows=3, periods=4, steps=12) == 12


def test_a_difference_stops_the_race():
    with pytest.raises(SystemExit):
        vector._check_equal([np.zeros(2)], [np.ones(2)], 1)


def test_vector(monkeypatch):
    monkeypatch.setattr(vector, "TARGETS", {500: 4.0})
    monkeypatch.setattr(vector, "ROWS", 4)
    monkeypatch.setattr(vector, "SHORT_ROWS", (1, 4))
    result = whole(vector.measure(GLANCE, QUIET), 1)
    assert len(result.plots[0].lines) == 3


def test_the_replayed_filter_does_the_work_of_the_episode():
    episode = overhead.Episode(rows=16, particles=400)  # raises if any bit differs
    assert len(episode.record.corrections) == 100
    assert sum(one.resampled.sum() for one in episode.record.corrections) > 0
    assert episode.record.searches > 0  # the beliefs that a search moves too


def test_another_work_is_noticed():
    episode = overhead.Episode(rows=2, particles=100, periods=5)
    episode.record.corrections[2].reports.value[:] += 1.0
    with pytest.raises(SystemExit):
        episode._check_same_beliefs()


def test_overhead():
    result = whole(overhead.measure(GLANCE, QUIET, rows=4, particles=400, periods=10), 1)
    assert [row[0] for row in result.tables[0].rows][-1] == "whole step"


def test_nodes(monkeypatch):
    monkeypatch.setattr(nodes, "SHORT_NODES", (225, 400))
    monkeypatch.setattr(nodes, "EPISODES", 1)
    result = whole(nodes.measure(GLANCE, QUIET), 2)
    assert len(result.plots[0].lines) == 6


def test_the_same_density():
    wide = nodes.scenario_of(900, nodes.DENSITY)
    assert wide == nodes.FIXED | {"nodes": 900, "side_m": 200.0}
    assert nodes.scenario_of(900, nodes.SIDE)["side_m"] == 100.0


def test_bytes_are_those_of_every_array():
    lengths = dict(rows=2, nodes=50, instants=11)
    state = State.zeros(**lengths, particles=100)
    parts = memory.bytes_by_part(state)
    assert set(parts) == {item.name for item in fields(State)}
    assert sum(parts.values()) == sum(array.nbytes for _, array in state.leaves()) // 2
    assert parts["belief"] - memory.bytes_by_part(State.zeros(**lengths))["belief"] == 20 * 100
    assert parts["track"] == 11 * 32


def test_reading_a_recording(monkeypatch):
    result = whole(recording.measure(GLANCE, QUIET), 2)
    assert [row[0] for row in result.tables[0].rows] == ["read_track", "csv and float", "numpy.loadtxt"]
    monkeypatch.setattr(recording, "by_csv", lambda path: recording.by_numpy(path) + 1.0)
    with pytest.raises(SystemExit, match="csv and float and read_track do not read the same"):
        recording.measure(GLANCE, QUIET)


def test_frames(monkeypatch):
    result = whole(frames.measure(GLANCE, QUIET), 2)
    assert [row[0] for row in result.tables[0].rows] == ["wsn_env", "Pillow, jagged", "Pillow, smooth"]
    monkeypatch.setattr(frames, "by_pillow", lambda *_: np.zeros((10, 10, 3), np.uint8))
    with pytest.raises(SystemExit, match="Pillow, jagged lacks"):
        frames.measure(GLANCE, QUIET)


def test_training():
    result = whole(training.measure(GLANCE, QUIET), 1)
    one = result.figures["runs"][0]
    assert one["steps"] >= 3 * 32 * 16
    assert sum(one[part] for part in training.PARTS) == pytest.approx(100)


def test_episodes():
    result = whole(episodes.measure(GLANCE, QUIET), 2)
    assert len(result.tables[0].rows) == 2 * 7


def test_many_rows(monkeypatch):
    monkeypatch.setattr(many_rows, "SHORT_SIZES", (2, 16))
    result = whole(many_rows.measure(GLANCE, QUIET), 3)
    assert [row[0] for row in result.tables[0].rows] == ["2", "16"]


def test_whole_training(monkeypatch):
    monkeypatch.setattr(whole_training, "COMPARED", {"episodes": 6, "particles": 200})
    monkeypatch.setattr(whole_training, "ROWS", 16)
    monkeypatch.setattr(whole_training, "SHORT_ROLLOUT", 32)
    result = whole(whole_training.measure(GLANCE, QUIET), 0)
    raced = [row[0] for row in result.tables[0].rows]
    assert {whole_training.NATIVE, whole_training.TEXTBOOK} <= set(raced)
    assert len(raced) + len(result.skipped) == 4


def test_a_stopwatch_counts_inside_only():
    ticks = iter(range(100))
    watch = Stopwatch(lambda: next(ticks))
    for _ in range(3):
        next(ticks)
        with watch:
            pass
    assert watch() == 3
