"""Tracks: inside the field, at the right speeds, and honest about bad files."""

import os

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wsn_env import Scenario, ScenarioError, World
from wsn_env.scenario.tracks import Tracks

KEYS = st.integers(0, 2**64 - 1)


def tracks(count=1, key=0, **overrides):
    """(count, periods + 1, 4) tracks of as many rows."""
    world = World(Scenario.named("PreDC-v0", **(dict(particles=2, nodes=1) | overrides)), threads=1)
    keys = np.array([(key + i) % 2**64 for i in range(count)], np.uint64)
    return world.reset(keys).track


def positive(low, high):
    return st.floats(low, high, allow_nan=False)


@st.composite
def motions(draw):
    """Overrides that name a built-in motion with settings of all sizes that fit the field."""
    side, period = draw(positive(1, 1000)), draw(positive(0.01, 60))
    periods = draw(st.integers(1, 150))
    name = draw(st.sampled_from(["crossing", "straight", "sine", "circle", "turns", "waypoint", "cruise"]))
    speed = positive(1e-3, side / period)
    own = {
        "crossing": lambda: dict(
            margin_m=side * draw(positive(0, 0.4)),
            crossing_m=side * draw(positive(0.01, 0.25)),
            acceleration_ms2=draw(positive(0, 10)),
        ),
        "straight": lambda: dict(from_m=draw(positive(0, 2 * side)), velocity_ms=draw(positive(-1000, 1000))),
        "sine": lambda: dict(
            speed_ms=draw(positive(1e-3, 100)),
            amplitude_m=side * draw(positive(0, 0.5)),
            turn_s=period * draw(positive(1, 1000)),
        ),
        "circle": lambda: dict(circle_m=side * draw(positive(0.01, 0.5)), turn_s=period * draw(positive(1, 1000))),
        "turns": lambda: dict(speed_ms=draw(speed), turn_probability=draw(positive(0, 1))),
        "waypoint": lambda: dict(speed_ms=draw(speed)),
        "cruise": lambda: dict(
            speed_ms=draw(positive(1e-3, 0.99)) * 0.7 * side / (periods * period),
            acceleration_ms2=draw(positive(0, 10)),
            inset_m=0.2 * side,
            margin_m=0.1 * side,
        ),
    }[name]()
    return dict(motion=name, side_m=side, period_s=period, periods=periods) | own


@settings(max_examples=150, deadline=None, derandomize=True)
@given(motions(), KEYS)
def test_every_track_stays_inside_the_field(overrides, key):
    track = tracks(4, key, **overrides)
    assert track.shape == (4, overrides["periods"] + 1, 4)
    assert np.isfinite(track).all()
    assert track[:, :, ::2].min() >= 0 and track[:, :, ::2].max() <= overrides["side_m"]


def test_crossings_join_two_far_points_of_the_inner_field():
    track = tracks(300, acceleration_ms2=0.0)
    start, end = track[:, 0, ::2], track[:, -1, ::2]
    assert np.linalg.norm(end - start, axis=1).min() >= 40 - 1e-9
    for point in (start, end):
        assert point.min() >= 10 - 1e-9 and point.max() <= 90 + 1e-9
    np.testing.assert_allclose(track[:, 0, 1::2] * 100, end - start, atol=1e-9)
    np.testing.assert_allclose(np.diff(track[:, :, ::2], axis=1), track[:, :-1, 1::2], atol=1e-9)


def test_the_crossings_noise_is_white_acceleration():
    track = tracks(200)
    inside = (track[:, :, ::2] > 1).all(axis=(1, 2)) & (track[:, :, ::2] < 99).all(axis=(1, 2))  # not reflected
    velocity = track[inside][:, :, 1::2]
    a = np.diff(velocity, axis=1).ravel()
    assert abs(a.mean()) < 4 * 0.025 / a.size**0.5
    assert abs(a.std() / 0.025 - 1) < 4 / (2 * a.size) ** 0.5
    middle = (velocity[:, 1:] + velocity[:, :-1]) / 2  # x + T v + T^2/2 a is the mean velocity's way
    np.testing.assert_allclose(np.diff(track[inside][:, :, ::2], axis=1), middle, atol=1e-9)


def test_crossings_never_bounce():
    """Their velocity changes by noise only: no episode turns at the border."""
    velocity = tracks(1000)[:, :, 1::2]
    assert np.abs(np.diff(velocity, axis=1)).max() < 6 * 0.025


def test_the_straight_diagonal():
    track = tracks(1, motion="straight")[0]
    np.testing.assert_allclose(track[:, 0], 5 + 0.9 * np.arange(101), atol=1e-12)
    np.testing.assert_array_equal(track[:, 0], track[:, 2])
    assert (track[:, 1::2] == 0.9).all()


def test_a_straight_track_is_reflected_at_the_border():
    track = tracks(1, motion="straight", velocity_ms=1.0, from_m=90)[0]
    assert track[10, 0] == 100 and track[15, 0] == 95 and track[15, 1] == -1 and track[9, 1] == 1


def test_the_circle():
    track = tracks(1, motion="circle")[0]
    offset = track[:, ::2] - 50
    np.testing.assert_allclose(np.linalg.norm(offset, axis=1), 30, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(track[:, 1::2], axis=1), 2 * np.pi * 30 / 100, rtol=1e-9)
    np.testing.assert_allclose((offset * track[:, 1::2]).sum(axis=1), 0, atol=1e-9)
    np.testing.assert_allclose(track[100], track[0], atol=1e-9)


def test_the_sine():
    track = tracks(1, motion="sine")[0]
    t = np.arange(101)
    np.testing.assert_allclose(track[:, 0], 5 + 0.9 * t, atol=1e-9)
    np.testing.assert_allclose(track[:, 2], 50 + 25 * np.sin(2 * np.pi * t / 100), atol=1e-9)
    np.testing.assert_allclose(track[:, 3], 0.5 * np.pi * np.cos(2 * np.pi * t / 100), atol=1e-9)


@pytest.mark.parametrize("motion", ["turns", "waypoint"])
def test_wanderers_keep_their_speed(motion):
    track = tracks(50, motion=motion, speed_ms=1.7)
    np.testing.assert_allclose(np.linalg.norm(track[:, :, 1::2], axis=2), 1.7, rtol=1e-9)
    way = np.linalg.norm(np.diff(track[:, :, ::2], axis=1), axis=2)
    assert way.max() <= 1.7 + 1e-9  # less where a corner is cut
    assert np.median(way) == pytest.approx(1.7, rel=1e-9)
    assert track[:, :, ::2].std() > 15  # they get about


def test_turns_are_as_frequent_as_wished_and_within_a_quarter_turn():
    track = tracks(200, motion="turns", speed_ms=0.1, turn_probability=0.2)
    away = (np.abs(track[:, :, ::2] - 50) < 49).all(axis=2)  # from the border's mirror
    heading = np.unwrap(np.arctan2(track[:, :, 3], track[:, :, 1]), axis=1)
    turn = np.diff(heading, axis=1)[away[:, 1:] & away[:, :-1]]
    turned = np.abs(turn) > 1e-9
    assert abs(turned.mean() - 0.2) < 4 * (0.16 / turn.size) ** 0.5
    assert np.abs(turn).max() <= np.pi / 2 + 1e-9
    assert abs(turn[turned].std() - np.pi / 12**0.5) < 4 * np.pi / 12**0.5 / turned.sum() ** 0.5


@pytest.mark.interpreted
def test_tracks_differ_from_key_to_key_and_repeat_with_it():
    for motion in ("crossing", "turns", "waypoint"):
        some = tracks(20, motion=motion)
        assert len(np.unique(some[:, 0, 0])) == 20
        np.testing.assert_array_equal(tracks(1, 7, motion=motion)[0], some[7])


@pytest.mark.parametrize(
    ("overrides", "names"),
    [
        (dict(motion="crossing", crossing_m=150), "Crossing.crossing_m = 150"),
        (dict(motion="crossing", margin_m=50), "Crossing.margin_m = 50"),
        (dict(motion="circle", circle_m=51), "Circle.circle_m = 51"),
        (dict(motion="circle", turn_s=0.1), "Circle.turn_s = 0.1"),
        (dict(motion="sine", amplitude_m=51), "Sine.amplitude_m = 51"),
        (dict(motion="sine", turn_s=0.9), "Sine.turn_s = 0.9"),
        (dict(motion="waypoint", speed_ms=1e300), "Waypoint.speed_ms = 1e+300"),
        (dict(motion="turns", speed_ms=101), "Turns.speed_ms = 101"),
    ],
)
def test_motions_without_room_are_refused(overrides, names):
    with pytest.raises(ScenarioError) as problem:
        tracks(1, **overrides)
    assert names in str(problem.value) and "must be" in str(problem.value)


# --- straight legs ------------------------------------------------------------------------------------------


def legs(start, *pieces, **overrides):
    return tracks(motion="legs", start_m=start, legs=pieces, **overrides)[0]


def test_legs_are_walked_one_after_the_other_and_then_the_target_stands():
    track = legs((20, 15), (4, 5, 2), (2, -1, 3), periods=8)
    np.testing.assert_allclose(track[:, 0], [20, 25, 30, 35, 40, 39, 38, 38, 38])
    np.testing.assert_allclose(track[:, 2], [15, 17, 19, 21, 23, 26, 29, 29, 29])
    np.testing.assert_array_equal(track[:, 1], [5, 5, 5, 5, 5, -1, -1, 0, 0])
    np.testing.assert_array_equal(track[:, 3], [2, 2, 2, 2, 2, 3, 3, 0, 0])


def test_a_turn_within_a_period_cuts_no_corner():
    pieces = (12.5, 3, 1), (12.5, -2, 1), (25, 0.5, -0.5)
    fine = legs((20, 15), *pieces, periods=500, period_s=0.1)
    for period_s, stride in ((0.2, 2), (0.5, 5), (1.0, 10)):
        coarse = legs((20, 15), *pieces, periods=int(50 / period_s), period_s=period_s)
        np.testing.assert_allclose(coarse[:, ::2], fine[::stride, ::2], atol=1e-9)


def test_legs_are_the_same_for_every_key_and_may_touch_the_border():
    overrides = dict(motion="legs", side_m=500, start_m=(0, 500), legs=((50, 10, -10),), periods=500, period_s=0.1)
    some = tracks(3, key=7, **overrides)
    assert (some == some[0]).all()
    np.testing.assert_allclose(some[0, :, 0], np.linspace(0, 500, 501), atol=1e-9)
    np.testing.assert_allclose(some[0, :, 2], np.linspace(500, 0, 501), atol=1e-9)
    assert (some[0, :, 1] == 10).all() and (some[0, :, 3] == -10).all()  # not turned by the border's mirror


@pytest.mark.parametrize(
    ("overrides", "says"),
    [
        (dict(legs=()), ["Legs.legs = ()", "triples"]),
        (dict(legs=((1, 2),)), ["Legs.legs = ((1, 2),)", "triples"]),
        (dict(legs=((1, 2, 3), (1, 2))), ["Legs.legs", "triples"]),
        (dict(legs=(1, 2, 3)), ["Legs.legs = (1, 2, 3)", "triples"]),
        (dict(legs="ten"), ["Legs.legs = 'ten'", "triples"]),
        (dict(legs=((1, 2, np.nan),)), ["Legs.legs", "finite"]),
        (dict(legs=((0, 2, 3),)), ["Legs.legs = ((0, 2, 3),)", "longer than 0 s"]),
        (dict(legs=((5, 1, 1), (-1, 2, 3))), ["Legs.legs", "longer than 0 s"]),
        (dict(start_m=5), ["Legs.start_m = 5", "pair"]),
        (dict(start_m=(1, 2, 3)), ["Legs.start_m = (1, 2, 3)", "pair"]),
        (dict(start_m=(1, np.inf)), ["Legs.start_m", "finite"]),
        (dict(start_m=(101, 5), legs=((1, -1, 0),)), ["Legs.legs", "(101.0, 5.0) m at 0 s", "in the field 0..100.0 m"]),
        (dict(start_m=(0, 50), legs=((9, 1, 0), (2, -5, 0))), ["Legs.legs", "(-1.0, 50.0) m at 11 s"]),
    ],
)
def test_bad_legs_are_refused(overrides, says):
    with pytest.raises(ScenarioError) as problem:
        tracks(motion="legs", **overrides)
    assert all(word in str(problem.value) for word in says), problem.value


# --- recorded tracks ----------------------------------------------------------------------------------------


@pytest.fixture
def write(tmp_path):
    def write(text, name="walk.csv", encoding="utf-8"):
        path = tmp_path / name
        path.write_text(text, encoding=encoding)
        return str(path)

    return write


def recorded(*paths, count=1, key=0, **overrides):
    return tracks(count, key, motion="recorded", tracks=paths, **overrides)


def test_a_recorded_track_is_resampled_to_the_horizon(write):
    path = write("t,x,y\n0,10,20\n4,30,20\n10,30,80\n")
    track = recorded(path, span_m=None, periods=10)[0]
    np.testing.assert_allclose(track[:, 0], [10, 15, 20, 25, 30, 30, 30, 30, 30, 30, 30])
    np.testing.assert_allclose(track[:, 2], [20, 20, 20, 20, 20, 30, 40, 50, 60, 70, 80])
    np.testing.assert_allclose(track[:, 1], [5, 5, 5, 5, 2.5, 0, 0, 0, 0, 0, 0])
    twice = recorded(path, span_m=None, periods=20, period_s=0.5)[0]
    np.testing.assert_allclose(twice[::2, ::2], track[:, ::2])


def test_a_recorded_track_is_scaled_and_centred(write):
    path = write("t,y,x,extra\n5,1000,-7,a\n6,1001,-7,b\n7,1001,-5,c\n")  # 2 m wide, 1 m high
    track = recorded(path, periods=2)[0]
    np.testing.assert_allclose(track[:, 0], [10, 10, 90])
    np.testing.assert_allclose(track[:, 2], [30, 70, 70])
    small = recorded(path, periods=2, span_m=500.0)[0]  # no larger than the field
    np.testing.assert_allclose(small[:, 0], [0, 0, 100])


@pytest.mark.interpreted
def test_an_episode_picks_one_of_the_recordings_by_its_key(write):
    paths = [write(f"t,x,y\n0,{x},1\n1,{x},2\n", f"{x}.csv") for x in (10, 20, 30)]
    starts = recorded(*paths, count=600, span_m=None)[:, 0, 0]
    counts = np.array([(starts == x).sum() for x in (10, 20, 30)])
    assert counts.sum() == 600
    assert (np.abs(counts - 200) < 4 * (600 * 2 / 9) ** 0.5).all()


def test_spreadsheets_write_a_byte_order_mark(write):
    assert np.isfinite(recorded(write("t,x,y\n0,1,1\n1,2,2\n", encoding="utf-8-sig"))).all()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("t,x\n0,1\n1,2\n", "column 'y' is missing"),
        ("", "column 't' is missing"),
        ("t,x,y,x\n0,1,1,1\n1,2,2,2\n", "column 'x' is there twice: the header must name t, x, y"),
        ("T,X,Y\n0,1,1\n", "it is 'T,X,Y'"),
        (
            "t;x;y\n0;1,5;1\n",
            "the header must name t, x, y with commas between them; it is 't;x;y'",
        ),
        ("t\tx\ty\n0\t1\t1\n", "column 't' is missing"),
        ("c" * 9999 + "\n", "it is 'ccc"),
        ("t,x,y\n0,0,10,5\n1,0,20,5\n", "line 2: has 4 fields: must be 3, as in the header"),
        ("t,x,y\n0,1,1\n1,2,2,2\n", "line 3: has 4 fields"),
        ("t,x,y,note\n0,1,1,a\n1,2,2\n", "line 3: has 3 fields: must be 4"),
        ('t,x,y\n"0,5","1","1"\n', "line 2: t: '0,5' is not a number"),
        ("t,x,y\n0,1_0,1\n1,2,2\n", "line 2: x: '1_0' is not a number"),
        ("t,x,y\n0,1,1\n1,2,\uff12\n", "line 3: y: '\uff12' is not a number"),
        (
            "t,x,y\n2020-02-09T12:00:01,1,1\n",
            "line 2: t: '2020-02-09T12:00:01' is not a number: a date must be",
        ),
        ("t,x,y\n09.02.2020,1,1\n", "a date must be given in seconds"),
        ("t,x,y\n12:00:01.5,1,1\n", "a date must be given in seconds"),
        ('t,x,y\n0,"1,1\n' + "1,2,2\n" * 9000, "line 2: cannot be read: "),
        ('t,x,y\n0,1,1\n1,"2"5,2\n', "line 3: cannot be read: ',' expected after '\"': is there a stray quote?"),
        ('t,x,y\n0,1,1\n1,2"5,2\n', "line 3: x: '2\"5' is not a number"),
        ('t,x,y,n\n0,1,1,"a\n1,2,2,b\n2,3,3,c"\n', "line 2: goes on to line 4: is there a stray quote?"),
        ("t,x,y\n-1e308,1,1\n1e308,2,2\n", "up to 1e+308 are too large to be resampled"),
        ("t,x,y\n0,-1e308,1\n1,1e308,2\n", "up to 1e+308 are too large to be resampled"),
        ("t,x,y\n0,1e307,1\n1,1e308,2\n", "up to 1e+308 are too large to be resampled"),
        (
            "t,x,y\n" + "".join(f"{1.6e9 + k},{k},1\n" for k in range(9)) + "1600000009000,9,1\n",
            "line 11: t=1.6e+12 comes after t=1.6e+09, 100.0% of the whole track: must be in the same unit",
        ),
        ("t,x,y\n0,1,1\n1,nan,2\n", "line 3: t=1.0, x=nan"),
        ("t,x,y\n0,1,1\n1,inf,2\n", "line 3"),
        ("t,x,y\n0,1,1\n1,two,2\n", "line 3"),
        ("t,x,y\n0,1,1\n1,2\n", "line 3"),
        ("t,x,y\n0,1,1\n\n2,1,1\n2,2,2\n", "line 5: t=2.0 must be later than 2.0"),
        ("t,x,y\n0,1,1\n-1,2,2\n", "line 3: t=-1.0 must be later than 0.0"),
        ("t,x,y\n0,1,1\n", "has 1 points: at least 2"),
        ("t,x,y\n", "has 0 points: at least 2"),
        ("t,x,y\n0,1,1\n1,1,1\n", "does not move"),
        ("t,x,y\n0," + "9" * 200_000 + ",1\n", "cannot be read"),
    ],
)
def test_bad_files_are_named_with_the_line(write, text, message):
    path = write(text)
    with pytest.raises(ScenarioError) as problem:
        recorded(path)
    assert path in str(problem.value) and message in str(problem.value)
    assert "\n" not in str(problem.value) and len(str(problem.value)) < 200 + len(path)


@pytest.mark.parametrize("unit_s", [1, 1e-3, 1e-6, 1e-9, 60, 3600])
@pytest.mark.parametrize("start_s", [0, 1581249601])
def test_any_unit_of_time_gives_the_same_track(write, unit_s, start_s):
    """Only the share of the whole counts."""
    seconds = np.array([0, 4, 10, 11, 20])
    points = np.array([[10, 20], [30, 20], [30, 80], [35, 80], [90, 15]])

    def text(times):
        return "t,x,y\n" + "".join(f"{t!r},{x},{y}\n" for t, (x, y) in zip(times, points.tolist()))

    found = recorded(write(text(((seconds + start_s) / unit_s).tolist())), periods=20)
    plain = recorded(write(text(seconds.tolist()), "plain.csv"), periods=20)
    np.testing.assert_allclose(found, plain, rtol=1e-6, atol=1e-4)


@pytest.mark.parametrize(
    "text",
    [
        "t,x,y\r\n0,1,1\r\n1,2,2\r\n",
        "t,x,y\r0,1,1\r1,2,2\r",
        't,x,y\n"0","1","1"\n"1","2","2"\n',
        '"t", "x", "y"\n0, 1, 1\n1, 2, 2\n',
        "t,x,y,\n0,1,1,\n1,2,2,\n",
        "t,x,y\n0,1,1,\n1,2,2,\n",
        "\nt,x,y\n\n0,1,1\n\n1,2,2\n\n",
        'y,note,x,note,t\n1,"a, b",1,,0\n2,,2,,1\n',
        "t,x,y\n0.0,1e0,+1\n1.0,2E0,2.",
    ],
)
def test_ways_to_write_the_same_track(write, text):
    plain = recorded(write("t,x,y\n0,1,1\n1,2,2\n", "plain.csv"), span_m=None)
    np.testing.assert_array_equal(recorded(write(text), span_m=None), plain)


def test_missing_and_unreadable_files_are_named(tmp_path):
    picture = tmp_path / "picture.csv"
    picture.write_bytes(b"\xff\xd8\xff\xe0 not text")
    wide = tmp_path / "wide.csv"
    wide.write_text("t,x,y\n0,1,1\n1,2,2\n", encoding="utf-16")
    os.mkfifo(tmp_path / "pipe.csv")
    for path in (tmp_path / "none.csv", tmp_path, picture, wide, tmp_path / "pipe.csv", "/dev/zero"):
        with pytest.raises(ScenarioError) as problem:
            recorded(str(path))
        assert str(path) in str(problem.value) and "cannot be read" in str(problem.value)


def test_a_recording_outside_the_field_is_refused_unless_scaled(write):
    path = write("t,x,y\n0,-1.1,5\n1,7,5\n")
    with pytest.raises(ScenarioError, match="must lie in the field of 100 x 100 m, or at most 1 m outside, or give"):
        recorded(path, span_m=None)
    assert recorded(path).min() < 100


def test_a_recording_may_step_a_little_outside_and_stays_as_it_was(write):
    path = write("t,x,y\n0,-0.14,5\n1,7,100.9\n")
    track = recorded(path, span_m=None, periods=1)[0]
    np.testing.assert_array_equal(track[:, ::2], [[-0.14, 5], [7, 100.9]])


def test_recorded_needs_a_file():
    with pytest.raises(ScenarioError, match="Recorded.tracks"):
        Scenario.named("PreDC-v0", motion="recorded")


CRUISE = dict(motion="cruise", side_m=1000.0, period_s=5.0)


def test_a_cruise_starts_inside_at_its_speed_and_keeps_its_distance():
    track = tracks(400, **CRUISE)
    assert track[:, 0, ::2].min() >= 200 and track[:, 0, ::2].max() <= 800
    assert track[:, :, ::2].min() >= 60 and track[:, :, ::2].max() <= 940
    np.testing.assert_allclose(np.linalg.norm(track[:, 0, 1::2], axis=1), 1.0, rtol=1e-9)
    heading = track[:, 0, 1::2].mean(axis=0)  # of unit vectors in all directions
    assert (np.abs(heading) < 4 / (2 * 400) ** 0.5).all()


def test_a_cruises_noise_is_white_acceleration():
    """Short ones, of which none had to be drawn again for its noise."""
    track = tracks(2000, periods=10, acceleration_ms2=0.02, **CRUISE)
    velocity = track[:, :, 1::2]
    a = np.diff(velocity, axis=1).ravel() / 5
    assert abs(a.mean()) < 4 * 0.02 / a.size**0.5
    assert abs(a.std() / 0.02 - 1) < 4 / (2 * a.size) ** 0.5
    middle = (velocity[:, 1:] + velocity[:, :-1]) / 2
    np.testing.assert_allclose(np.diff(track[:, :, ::2], axis=1), 5 * middle, atol=1e-9)


def test_a_cruise_that_noise_would_drive_out_goes_without():
    track = tracks(20, acceleration_ms2=50.0, **CRUISE)
    assert track[:, :, ::2].min() >= 60 and track[:, :, ::2].max() <= 940
    np.testing.assert_array_equal(track[:, 1:, 1::2], track[:, :-1, 1::2])


@pytest.mark.parametrize(
    ("overrides", "says"),
    [
        (
            dict(inset_m=30.0),
            "Cruise.inset_m = 30.0: must be at least margin_m = 60.0 and below half the side",
        ),
        (dict(inset_m=500.0), "Cruise.inset_m = 500.0"),
        (dict(speed_ms=3.0), "Cruise.speed_ms = 3.0: must be at most 1.48 m/s"),
        (dict(speed_ms=0), "Cruise.speed_ms = 0: must be a finite number above 0"),
    ],
)
def test_cruises_without_room_are_refused(overrides, says):
    with pytest.raises(ScenarioError) as problem:
        tracks(1, **CRUISE, **overrides)
    assert says in str(problem.value)


def test_a_free_target_follows_its_law_and_may_leave_the_field():
    """Variances of start and end in the large: P0, and F P0 F' + q^2 sum of (F^k G)(F^k G)'; 4,000 tracks, 4.5 sds."""
    scenario = Scenario.named("PreDC-v0", motion="free", speed_ms=0.3, acceleration_ms2=0.05)
    count, periods = 4000, scenario.periods
    tracks = np.empty((count, periods + 1, 4))
    Tracks(scenario).draw(np.ones(count, bool), np.arange(count, dtype=np.uint64), tracks, 1)
    end = 8.0**2 + (100 * 0.3) ** 2 + 0.05**2 * sum((k + 0.5) ** 2 for k in range(periods))
    for axis in (0, 2):
        for period, variance in ((0, 8.0**2), (periods, end)):
            found = tracks[:, period, axis]
            assert abs(found.mean() - 50) < 4.5 * (variance / count) ** 0.5
            assert abs(found.var() / variance - 1) < 4.5 * (2 / count) ** 0.5
    assert ((tracks[:, -1, ::2] < 0) | (tracks[:, -1, ::2] > 100)).any(axis=1).mean() > 0.1
