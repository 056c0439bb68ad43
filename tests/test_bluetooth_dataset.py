"""Recorded Bluetooth tracks: every line is kept or counted, every error names its place; WSN_BLE_DIR names the real."""

import datetime
import os
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

from wsn_env.bluetooth.synthetic import (
    BEACON,
    BEACON_M,
    INTERVAL_S,
    LOSS,
    NAMES,
    ROOM_M,
    receiver_positions,
    write_dataset,
)
from wsn_env.models.quantity import ScenarioError
from wsn_env.models.recordings.dataset import (
    ASTRAY_S,
    GAP_S,
    REASONS,
    Track,
    read_dataset,
    read_track,
    track_files,
)
from wsn_env.models.recordings.files import DatasetError, DatasetWarning
from wsn_env.models.recordings.receivers import OUTSIDE_M, Receivers, in_room, read_receivers

FOLDER = os.environ.get("WSN_BLE_DIR")
ROOT = Path(__file__).parents[1]
COPIES = 1000
pytestmark = pytest.mark.filterwarnings("ignore::wsn_env.models.recordings.files.DatasetWarning")
TIME, RECEIVER, BEACON_ID, LEVEL, X, Y, Z = range(7)


@pytest.fixture(scope="module")
def clean(tmp_path_factory) -> Path:
    """A file of some 15 s that nothing is wrong with."""
    return track_files(write_dataset(tmp_path_factory.mktemp("clean"), tracks=1, seconds=15))[0]


@pytest.fixture
def folder(tmp_path) -> Path:
    return write_dataset(tmp_path, tracks=1, seconds=15)


def packet(time_s, receiver=NAMES[0], level=-70, x=3.0, y=4.0, z=1.8, beacon=BEACON) -> bytes:
    return f"{time_s},{receiver},{beacon},{level},{x},{y},{z},0,0,-1,1,0,0,0,-1,0".encode()


def changed(line: bytes, field: int, value) -> bytes:
    fields = line.split(b",")
    fields[field] = value if isinstance(value, bytes) else str(value).encode()
    return b",".join(fields)


def read(folder: Path, lines, end=b"\n", **keywords) -> Track:
    """The track of these lines, in a folder with receivers."""
    path = folder / "own.mbd"
    path.write_bytes(b"".join(line + end for line in lines))
    return adds_up(read_track(path, **keywords))


def adds_up(track: Track) -> Track:
    """Whatever was read is whole and counted."""
    reasons = {name: track.counts[name] for name in REASONS}
    assert set(track.counts) == {"lines", "kept", *REASONS} and min(track.counts.values()) >= 0
    assert track.counts["lines"] == track.counts["kept"] + sum(reasons.values())
    count = track.counts["kept"]
    assert track.time_s.shape == track.receiver.shape == track.level_db.shape == (count,)
    assert track.position_m.shape == (count, 3)
    assert track.time_s[0] == 0 and (np.diff(track.time_s) >= 0).all() and track.longest_gap_s <= ASTRAY_S
    assert ((track.receiver >= 0) & (track.receiver < len(track.receivers.names))).all()
    assert np.isfinite(track.position_m).all() and ((track.level_db > -120) & (track.level_db < -20)).all()
    levels, heard, positions = track.per_period()
    assert len(levels) == len(heard) == len(positions) == int(track.time_s[-1]) > 0
    assert np.isfinite(levels).all() and np.isfinite(positions).all()
    assert heard.sum() == (track.time_s < len(heard)).sum() and ((levels != 0) == (heard > 0)).all()
    return track


def same(one: Track, other: Track) -> bool:
    arrays = ("time_s", "receiver", "level_db", "position_m")
    return one.counts == other.counts and all(np.array_equal(getattr(one, a), getattr(other, a)) for a in arrays)


# --- what is read -------------------------------------------------------------------------------------------


def test_the_fields_are_those_of_the_file(folder):
    track = read(folder, [packet(100.25, NAMES[3], -71, 1, 2, 1.7), packet(102.5, NAMES[1], -80.5, 5, 6, 1.9)])
    assert track.name == "own" and track.path == folder / "own.mbd"
    assert track.time_s.tolist() == [0, 2.25] and track.receiver.tolist() == [3, 1]
    assert track.level_db.tolist() == [-71, -80.5] and track.position_m.tolist() == [[1, 2, 1.7], [5, 6, 1.9]]
    assert track.counts == {"lines": 2, "kept": 2} | dict.fromkeys(REASONS, 0)
    with pytest.raises(ValueError):
        track.time_s[0] = 1.0  # it may be shared


def test_the_folder(tmp_path):
    write_dataset(tmp_path, tracks=3, seconds=5)
    (tmp_path / "._walk_0_all_sensors.mbd").write_bytes(b"\0resource fork")
    tracks = read_dataset(str(tmp_path))
    assert [track.name for track in tracks] == ["walk_0", "walk_1", "walk_2"]
    assert [track.path for track in tracks] == track_files(tmp_path)
    receivers = read_receivers(tmp_path)
    assert receivers.names == NAMES and receivers.limits_m == ROOM_M and receivers.beacons == (BEACON,)
    np.testing.assert_array_equal(receivers.positions_m, receiver_positions())
    alone = read_track(str(track_files(tmp_path)[1]))
    assert same(alone, tracks[1]) and not same(tracks[0], tracks[1])


def test_the_synthetic_walk_is_as_described(tmp_path):
    answer = subprocess.run(
        [sys.executable, "-m", "wsn_env.bluetooth.synthetic", tmp_path / "a"], capture_output=True, text=True
    )
    assert answer.returncode == 0, answer.stderr
    write_dataset(tmp_path / "b")
    for track, other in zip(read_dataset(tmp_path / "a"), read_dataset(tmp_path / "b"), strict=True):
        adds_up(track)
        assert same(track, other) and track.counts["kept"] == track.counts["lines"]
        sent = int(40 / INTERVAL_S) + 1
        assert abs(len(track.time_s) / sent / len(NAMES) - (1 - LOSS)) < 0.05
        assert (track.position_m[:, 2] == BEACON_M).all() and (track.level_db == np.round(track.level_db)).all()
        steps = np.linalg.norm(np.diff(track.per_period()[2], axis=0), axis=1)
        assert 0.35 < np.median(steps) < 0.55


@pytest.mark.parametrize("end", [b"\n", b"\r\n", b"\r"])
def test_ends_of_lines_and_a_byte_order_mark(clean, folder, end):
    lines = clean.read_bytes().splitlines()
    assert same(read(folder, [b"\xef\xbb\xbf" + lines[0], *lines[1:]], end), read_track(clean))


# --- faults -------------------------------------------------------------------------------------------------

FAULTS = {
    "nothing": (lambda line: b"", "blank"),
    "spaces": (lambda line: b" \t ", "blank"),
    "cut": (lambda line: line[: len(line) // 2], "malformed"),
    "too long": (lambda line: line + b",0", "malformed"),
    "two in one": (lambda line: line + line, "malformed"),
    "words": (lambda line: b"timestamp,receiver,beacon", "malformed"),
    "no time": (lambda line: changed(line, TIME, ""), "malformed"),
    "a letter": (lambda line: changed(line, LEVEL, "-7o"), "malformed"),
    "a word": (lambda line: changed(line, X, "nan"), "malformed"),
    "infinite": (lambda line: changed(line, TIME, "inf"), "malformed"),
    "too large": (lambda line: changed(line, Y, "1e999"), "malformed"),
    "an underscore": (lambda line: changed(line, X, "1_0"), "malformed"),
    "bad orientation": (lambda line: changed(line, 15, "-"), "malformed"),
    "zeros": (lambda line: b"\0" * 80, "malformed"),
    "no text": (lambda line: b"\xff\xfe\x80" * 30, "malformed"),
    "not ASCII": (lambda line: changed(line, LEVEL, "-７0"), "malformed"),
    "receiver": (lambda line: changed(line, RECEIVER, "00000000ffff"), "unknown receiver"),
    "receiver, no text": (lambda line: changed(line, RECEIVER, b"\xc3\x28"), "unknown receiver"),
    "beacon": (lambda line: changed(line, BEACON_ID, "000000000000"), "another beacon"),
    "loud": (lambda line: changed(line, LEVEL, 42), "impossible level"),
    "at the bound": (lambda line: changed(line, LEVEL, -20), "impossible level"),
    "faint": (lambda line: changed(line, LEVEL, "-120.0"), "impossible level"),
    "left": (lambda line: changed(line, X, -1.01), "impossible position"),
    "right": (lambda line: changed(line, X, ROOM_M[0] + 1.01), "impossible position"),
    "behind": (lambda line: changed(line, Y, ROOM_M[1] + 1.01), "impossible position"),
    "high": (lambda line: changed(line, Z, 8.0), "impossible position"),
    "far": (lambda line: changed(line, X, -1e300), "impossible position"),
    "early": (lambda line: changed(line, TIME, 600000001.5), "astray time"),
    "late": (lambda line: changed(line, TIME, 9600000001.5), "astray time"),
    "very late": (lambda line: changed(line, TIME, 1e300), "astray time"),
}


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("place", [0, 7, -1])
def test_a_bad_line_is_left_out_and_counted(clean, folder, fault, place):
    damage, reason = FAULTS[fault]
    lines = clean.read_bytes().splitlines()
    rest = read(folder, [line for line in lines if line is not lines[place]])
    lines[place] = damage(lines[place])
    track = read(folder, lines)
    assert track.counts == rest.counts | {"lines": len(lines), reason: 1}
    assert np.allclose(track.time_s, rest.time_s) and np.array_equal(track.level_db, rest.level_db)
    assert track.out_of_order == 0 or reason == "astray time"


def test_what_is_just_possible_is_kept(folder):
    edges = [(-1, -1, 1.8), (ROOM_M[0] + 1, ROOM_M[1] + 1, 1.8), (3, 4, -3.7), (3, 4, 7.2)]
    lines = [packet(k, NAMES[k], level, *edge) for k, (level, edge) in enumerate(zip((-119.9, -20.1, -50, -50), edges))]
    assert read(folder, lines).counts["kept"] == 4
    spaced = [line.replace(b",", b" , ") for line in lines]
    assert read(folder, spaced).counts["kept"] == 4


def test_a_packet_written_twice_counts_once(clean, folder):
    lines = clean.read_bytes().splitlines()
    once = read_track(clean)
    twice = read(folder, [*lines, lines[5], lines[5], lines[9]])
    assert twice.counts == once.counts | {"lines": len(lines) + 3, "repeated packet": 3}
    assert np.array_equal(twice.level_db, once.level_db)
    start = [packet(0), packet(2)]
    assert read(folder, [*start, packet(1), packet(1, level=-60)]).counts["repeated packet"] == 1  # cannot both be
    assert read(folder, [*start, packet(1), packet(1.0003)]).counts["repeated packet"] == 1
    assert read(folder, [*start, packet(1), packet(1.003)]).counts["kept"] == 4  # on another advertising channel
    assert read(folder, [*start, packet(1), packet(1, NAMES[1])]).counts["kept"] == 4


def test_order_of_lines_does_not_matter(clean, folder):
    lines = clean.read_bytes().splitlines()
    lines += [changed(lines[3], LEVEL, -60), changed(lines[4], X, 5), b"", b"nonsense", changed(lines[8], TIME, 1e9)]
    sorted_once = read(folder, lines)
    for seed in range(5):
        shuffled = read(folder, np.random.default_rng(seed).permutation(np.array(lines, object)))
        assert same(shuffled, sorted_once) and shuffled.out_of_order > 50
    swapped = [packet(k) for k in (0, 1, 3, 2, 4, 5)]
    assert read(folder, swapped).out_of_order == 1


def test_a_pause_parts_a_track(folder):
    seconds = [*range(5), *(ASTRAY_S + 4.5 + np.arange(9)), 1e6]
    track = read(folder, map(packet, seconds))
    assert track.counts["astray time"] == 6 and track.time_s.tolist() == list(range(9))
    track = read(folder, map(packet, (0, 1, 2, ASTRAY_S + 1, ASTRAY_S + 1.5)))
    assert track.counts["kept"] == 5 and track.gaps == 1 and track.longest_gap_s == ASTRAY_S - 1
    assert read(folder, map(packet, np.arange(9) * GAP_S)).gaps == 0


def test_the_beacon_is_a_named_one_or_the_most_frequent(folder):
    others = [packet(10 + k / 4, beacon="other") for k in range(20)]
    lines = [packet(10 + k, NAMES[1]) for k in range(5)] + others
    assert read(folder, lines).counts["another beacon"] == 20
    nobody = read_receivers(folder)
    nobody = Receivers(nobody.names, nobody.positions_m, nobody.limits_m)
    assert read(folder, lines, receivers=nobody).counts["another beacon"] == 5
    with pytest.raises(DatasetError, match=r"own\.mbd: none .*line 1: another beacon: 'other', not .*tetam\.dev"):
        read(folder, others)


# --- errors -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "lines, why",
    [
        ([], "none of its 0 lines"),
        ([b"", packet(1, "nobody")], "none of its 2 lines .*; line 1: blank"),
        ([b"1,2,3", b""], "line 1: malformed: 3 fields instead of 16"),
        ([changed(packet(1), LEVEL, "loud")], "line 1: malformed: 'loud' is not a number"),
        ([changed(packet(1), X, "nan")], "line 1: malformed: .*finite"),
        ([packet(1, "nobody")], "line 1: unknown receiver: 'nobody' is not in tetam.dev"),
        ([packet(1, level=5), packet(2, "nobody")], "line 1: impossible level: 5 dBm"),
        ([packet(1, x=99)], r"line 1: impossible position: \(99, 4, 1.8\) m .* 20.66 x 17.64 m"),
        ([packet(1)], "its 1 usable packets of 1 lines last 0 s: must be at least 1 s$"),
        ([packet(1), b"x", packet(1.9)], "2 usable packets of 3 lines last 0.9 s: .*; line 2: malformed"),
        ([packet(100 * k) for k in range(5)], "times must be in seconds, and look like ms: .* 100 s apart"),
        ([packet(100 * k, NAMES[k]) for k in range(5)], "its 1 usable packets of 5"),
    ],
)
def test_a_file_without_a_track(folder, lines, why):
    with pytest.raises(DatasetError, match=r"own\.mbd: .*" + why):
        read(folder, lines)


@pytest.mark.parametrize(
    "text, why",
    [
        ("", "no line Dongles"),
        ("Beacons:{}", "no line Dongles"),
        ("Dongles:{}", "line 1: Dongles holds no receiver"),
        ("\n[1, 2]\n", "line 2: must be Dongles"),
        ("Dongles:[1]", "line 1: must be a table"),
        ("Dongles:{'a': 1}", "line 1: .*double quotes"),
        ('Dongles:{"a": [[1, 2, 3]],\n"b": [[1, 2 3]]}', "line 2: .*delimiter"),
        ("Dongles:" + "[" * 100_000, "line 1: "),
        ('Dongles:{"a": [[1, 2]]}', r"line 1: receiver 'a' is at \[1, 2\]: must be \[x, y, z\]"),
        ('Dongles:{"a": []}', "receiver 'a' is at"),
        ('Dongles:{"a": {"b": 1}}', "receiver 'a' is at"),
        ('Dongles:{"a": [[1, 2, NaN]]}', "receiver 'a' is at"),
        ('Dongles:{"a": [[1, 2, true]]}', "receiver 'a' is at"),
        ('Dongles:{"a": [[1, 2, 1e5]]}', "within 10000 m"),
        ('Dongles:{"a": [[1, 2, 1' + "0" * 400 + "]]}", "receiver 'a' is at"),
        ('Dongles:{"a": [[1, 2, 3]], "a": [[1, 2, 3]]}', "line 1: 'a' is there twice"),
        ('Dongles:{"a": [[1, 2, 3]]}\nDongles:{"b": [[1, 2, 3]]}', "line 2: Dongles is there twice, first in line 1"),
        ('Dongles:{"a": [[1, 2, 3]]}\nBeacons:{', "line 2: "),
        ('Dongles:{"a": [[-1, 2, 3]]}', "no room: tetam.par must give"),
    ],
)
def test_bad_receivers(tmp_path, text, why):
    (tmp_path / "tetam.dev").write_text(text)
    with pytest.raises(DatasetError, match=r"tetam\.dev.*" + why):
        read_receivers(tmp_path)


def test_receivers_over_several_lines(tmp_path):
    text = 'Version: 2\n\nDongles:{"a": [[1, 2, 3], 5, "x"],\n  "b": [[4, 1, 3]]\n}\n\nBeacons:{"c": []}\n'
    (tmp_path / "tetam.dev").write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())
    receivers = read_receivers(tmp_path)
    assert receivers.names == ("a", "b") and receivers.beacons == ("c",) and receivers.limits_m == (4, 2)


@pytest.mark.parametrize(
    "text",
    ["", "{}", "[1]", "{'limits': 1}", '{"limits": [0, 0, 30]}', '{"limits": [0, 0, 30, "a"]}', "\xff", "[" * 100_000]
    + ['{"limits": [0, 0, 0, 20]}', '{"limits": [0, 0, 30, Infinity]}', '{"limits": [0, 0, 5, 5]}']
    + ['{"limits": [1, 0, 30, 20]}', '{"limits": [0, 0, 30, 1e9]}'],
)
def test_a_room_that_makes_no_sense_is_that_of_the_receivers(folder, text):
    far = tuple(receiver_positions()[:, :2].max(axis=0))
    (folder / "tetam.par").write_bytes(text.encode("latin-1"))
    assert read_receivers(folder).limits_m == far
    (folder / "tetam.par").unlink()
    assert read_receivers(folder).limits_m == far


def test_missing_files(tmp_path, clean):
    with pytest.raises(DatasetError, match="nowhere: is no folder"):
        read_dataset(tmp_path / "nowhere")
    with pytest.raises(DatasetError, match="holds no"):
        read_dataset(tmp_path)
    with pytest.raises(DatasetError, match=r"walk\.mbd: cannot be read: No such file"):
        read_track(tmp_path / "walk.mbd")
    (tmp_path / "walk.mbd").write_bytes(clean.read_bytes())
    with pytest.raises(DatasetError, match=r"tetam\.dev: cannot be read: No such file"):
        read_track(tmp_path / "walk.mbd")
    with pytest.raises(DatasetError, match="cannot be read: Is a directory"):
        read_track(tmp_path, read_receivers(clean.parent))


# --- units of time ------------------------------------------------------------------------------------------


def in_unit(line: bytes, of_time) -> bytes:
    return changed(line, TIME, of_time(float(line.split(b",")[TIME])))


@pytest.mark.parametrize("unit, seconds", [("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9), ("min", 60), ("h", 3600)])
@pytest.mark.parametrize("start_s", [0.0, 1.6e9])
@pytest.mark.parametrize("share", [1.0, 0.5, 0.2])
def test_times_in_another_unit_are_refused_by_its_name(clean, folder, unit, seconds, start_s, share):
    """All of them, or a part, as where two recorders were joined; the longest silences of a file in seconds are few."""
    if seconds > 1 and share < 1:
        pytest.skip("a part in a longer unit lies years off: astray")
    lines = clean.read_bytes().splitlines()
    every = round(1 / share)
    for k, line in enumerate(lines):
        length_s = seconds if k % every == 0 else 1
        lines[k] = changed(line, TIME, repr((float(line.split(b",")[TIME]) - 1.6e9 + start_s) / length_s))
    with pytest.raises(DatasetError, match=rf"own\.mbd: times must be in seconds, and look like {unit}: a receiver's"):
        read(folder, lines)


def test_dates_are_refused(clean, folder):
    lines = clean.read_bytes().splitlines()

    def iso(s):
        return datetime.datetime.fromtimestamp(s, datetime.UTC).isoformat()

    for write in (iso, lambda s: iso(s).replace("T", " "), lambda s: iso(s)[11:23], lambda s: iso(s)[:10]):
        with pytest.raises(DatasetError, match="line 1: malformed: '.*' is not a number: a date must be given in sec"):
            read(folder, [in_unit(line, write) for line in lines])


def test_whole_seconds_are_told(clean, folder):
    lines = [in_unit(line, int) for line in clean.read_bytes().splitlines()]
    with pytest.warns(DatasetWarning, match=r"own\.mbd: \d+ of \d+ lines .* repeated packet; times .* whole seconds"):
        track = read(folder, lines)
    assert 0.3 < track.counts["repeated packet"] / track.counts["lines"] < 0.6
    tenths = read(folder, [in_unit(line, lambda s: f"{s:.1f}") for line in clean.read_bytes().splitlines()])
    assert tenths.note is None and tenths.counts["repeated packet"] < 10


def test_packets_on_three_channels_and_pauses_are_in_seconds(folder):
    heard = [k / 10 + channel / 500 for k in range(200) for channel in range(3)]
    assert read(folder, map(packet, heard)).counts["kept"] == 600
    parts = [second + pause for pause in (0, 3600, 90_000) for second in range(20)]
    assert read(folder, map(packet, parts)).counts["astray time"] == 40


# --- files of which a part is used --------------------------------------------------------------------------


@pytest.mark.parametrize("fault", ["cut", "receiver", "beacon", "loud", "left", "early", "spaces"])
def test_more_than_a_tenth_left_out_is_told(clean, folder, fault):
    damage, reason = FAULTS[fault]
    lines = clean.read_bytes().splitlines()
    few, many = len(lines) // 10, len(lines) // 10 + 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert read(folder, [*map(damage, lines[:few]), *lines[few:]]).note is None
    with pytest.warns(DatasetWarning) as told:
        track = read(folder, [*map(damage, lines[:many]), *lines[many:]])
    kept = len(lines) - many
    assert track.note == f"{folder / 'own.mbd'}: {kept} of {len(lines)} lines are used; left out: {many} {reason}"
    assert [str(one.message) for one in told] == [track.note]


# --- what cannot be a file ----------------------------------------------------------------------------------


def test_pipes_devices_and_endless_files_are_not_read(tmp_path, clean):
    receivers = read_receivers(clean.parent)
    os.mkfifo(tmp_path / "pipe.mbd")
    with open(tmp_path / "endless.mbd", "wb") as file:
        file.truncate(2**40)
    for path, why in (
        (tmp_path / "pipe.mbd", "is a pipe or a device"),
        (Path("/dev/zero"), "is a pipe or a device"),
        (tmp_path / "endless.mbd", f"has {2**40} bytes: at most"),
    ):
        with pytest.raises(DatasetError, match=f"{path}: cannot be read: {why}"):
            read_track(path, receivers)


def test_two_files_of_one_tracks_name_are_refused(tmp_path):
    (path,) = track_files(write_dataset(tmp_path, tracks=1, seconds=3))
    path.with_name("walk_0.mbd").write_bytes(path.read_bytes())
    with pytest.raises(DatasetError, match="walk_0.mbd, walk_0_all_sensors.mbd: are 2 files of one track's name"):
        track_files(tmp_path)


# --- the room -----------------------------------------------------------------------------------------------


def test_a_room_holds_its_receivers(folder):
    (folder / "tetam.par").write_text('{"limits": [0, 0, 17.6, 17.0]}')  # receivers up to .99 and .11 m outside
    far = receiver_positions()[:, :2].max(axis=0)
    assert read_receivers(folder).limits_m == (max(17.6, far[0]), max(17.0, far[1]))


def test_one_rule_says_how_far_outside_counts():
    room = 20.0, 10.0
    edge = OUTSIDE_M + 1e-9
    assert in_room(np.array([-1.0, 21.0, 5.0]), np.array([11.0, -1.0, 5.0]), room).all()
    for x, y in ((-edge, 5), (20 + edge, 5), (5, -edge), (5, 10 + edge), (5, 19), (np.nan, 5)):
        assert not in_room(x, y, room)


# --- periods ------------------------------------------------------------------------------------------------


def test_periods(folder):
    lines = [
        packet(100.0, NAMES[0], -70, 1, 2),
        packet(101.99, NAMES[0], -74, 3, 4),
        packet(101.99, NAMES[2], -90, 3, 4),
        packet(102.0, NAMES[2], -80, 5, 4),  # the second period
        packet(108.5, NAMES[1], -60, 8, 10),  # the fifth, which is not whole
    ]
    levels, heard, positions = read(folder, lines).per_period(2.0)
    assert levels.shape == heard.shape == (4, 12) and heard.dtype == int
    assert heard[:, :3].tolist() == [[2, 0, 1], [0, 0, 1], [0, 0, 0], [0, 0, 0]] and heard.sum() == 4
    assert levels[:2, :3].tolist() == [[-72, 0, -90], [0, 0, -80]] and np.count_nonzero(levels) == 3
    np.testing.assert_allclose(positions, [[7 / 3, 10 / 3], [5, 4], [6, 6], [7, 8]])


def test_periods_that_cannot_be(clean):
    track = read_track(clean)
    with pytest.raises(DatasetError, match=r"walk_0_all_sensors\.mbd: lasts 14\.\d s: no whole period of 15 s"):
        track.per_period(15)
    for period_s in (0, -1, np.nan, np.inf, 1e-9, "1", None):
        with pytest.raises(ScenarioError, match="period_s"):
            track.per_period(period_s)


# --- damage -------------------------------------------------------------------------------------------------


def damaged(data: bytes, rng) -> bytes:
    """With one to many faults: bytes, digits, whole lines."""
    for _ in range(rng.choice([1, 3, 30])):
        data = DAMAGE[rng.integers(len(DAMAGE))](bytearray(data), rng)
    return bytes(data)


def _byte(data, rng):
    data[rng.integers(len(data))] = rng.integers(256)
    return data


def _digit(data, rng):
    places = [i for i in rng.integers(len(data), size=20) if 48 <= data[i] < 58]
    for place in places[:3]:
        data[place] = 48 + rng.integers(10)
    return data


def _cut(data, rng):
    start = rng.integers(len(data))
    return data[:start] + data[start + rng.integers(1, 200) :] or bytearray(b"\n")


def _end(data, rng):
    return data[: rng.integers(len(data) // 2, len(data)) + 1]


def _insert(data, rng):
    start = rng.integers(len(data))
    word = (b"\n", b",", b"nan", b"-", b"e", b"\0", b"\xff", b"\r\n\r\n", b"1_0")[rng.integers(9)]
    return data[:start] + word + data[start:]


def _lines(change):
    def damage(data, rng):
        lines = bytes(data).split(b"\n")
        change(lines, rng.integers(len(lines)), rng.integers(len(lines)))
        return bytearray(b"\n".join(lines) or b"\n")

    return damage


def _swap(lines, i, j):
    lines[i], lines[j] = lines[j], lines[i]


def _swap_tails(lines, i, j):
    lines[i], lines[j] = lines[i][:40] + lines[j][40:], lines[j][:40] + lines[i][40:]


DAMAGE = (_byte, _digit, _cut, _end, _insert, _lines(_swap), _lines(_swap_tails))
DAMAGE += (_lines(lambda lines, i, j: lines.insert(i, lines[j])), _lines(lambda lines, i, j: lines.pop(i)))


def test_damaged_files_are_read_or_refused(clean, tmp_path):
    """And always add up, whatever the order of their lines."""
    receivers, data, path = read_receivers(clean.parent), clean.read_bytes(), tmp_path / "own.mbd"
    refused, found = 0, dict.fromkeys(REASONS, 0)
    for seed in range(COPIES):
        rng = np.random.default_rng(seed)
        if rng.random() < 0.3:
            data_here = b"\n".join(data.split(b"\n")[: rng.integers(1, 30)])  # not much of it
        else:
            data_here = data
        content = damaged(data_here, rng)
        path.write_bytes(content)
        try:
            track = adds_up(read_track(path, receivers))
        except DatasetError as problem:
            assert str(path) in str(problem), seed
            refused += 1
            continue
        for reason in REASONS:
            found[reason] += track.counts[reason]
        if seed % 10 == 0:
            assert same(
                read(tmp_path, rng.permutation(np.array(content.splitlines(), object)), receivers=receivers), track
            )
    assert 20 < refused < COPIES / 2
    assert min(found.values()) > 0, found


def test_damaged_receivers_are_read_or_refused(clean, tmp_path):
    refused = 0
    for seed in range(300):
        rng = np.random.default_rng(seed)
        for name in ("tetam.dev", "tetam.par"):
            (tmp_path / name).write_bytes(damaged((clean.parent / name).read_bytes(), rng))
        try:
            receivers = read_receivers(tmp_path)
        except DatasetError as problem:
            assert "tetam.dev" in str(problem), seed
            refused += 1
            continue
        assert receivers.positions_m.shape == (len(receivers.names), 3) and np.isfinite(receivers.positions_m).all()
        assert min(receivers.limits_m) > 0
        try:
            adds_up(read_track(clean, receivers))
        except DatasetError as problem:
            assert str(clean) in str(problem), seed
    assert 100 < refused < 300


# --- the recordings -----------------------------------------------------------------------------------------


@pytest.mark.skipif(not FOLDER, reason="WSN_BLE_DIR is not set")
def test_the_recordings():
    """Two packets of six tracks are corrupt; nobody is silent for longer than the beacon is."""
    tracks = {track.name: adds_up(track) for track in read_dataset(FOLDER)}
    assert {name: (track.counts["kept"], len(track.per_period()[0])) for name, track in tracks.items()} == {
        "rectangular_with_rotation": (1935, 83),
        "straight_01": (1365, 58),
        "straight_02": (1240, 54),
        "straight_04": (558, 24),
        "straight_05": (3463, 148),
        "zigzagging_without_rotation": (2203, 96),
    }
    for name, track in tracks.items():
        assert (
            track.counts["impossible level"]
            == track.counts["lines"] - track.counts["kept"]
            == 2 * (name == "straight_05")
        )
        assert track.gaps == 0 and 0.4525 < track.longest_gap_s < 0.46 and track.out_of_order <= 1
        assert (track.per_period()[1].sum(axis=1) > 0).all()
        receivers = track.receivers
        assert len(receivers.names) == 12 and receivers.limits_m == pytest.approx((20.66, 17.64), abs=0.01)
    assert receivers.names[0] == "b827eb4521b4" and receivers.positions_m[0].tolist() == [7.0, 7.09, 1.22]
    assert receivers.beacons == ("e78f135624ce",)
