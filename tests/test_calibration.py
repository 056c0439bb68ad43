"""Calibration of recorded tracks: what was simulated is found again, and what was recorded as well."""

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wsn_env import Scenario, World
from wsn_env.bluetooth import packets as packets_module
from wsn_env.bluetooth.calibration import Calibration
from wsn_env.bluetooth.covariance import Autocovariance, autocovariance, bias_covariance, fit_bias, lagged_covariance
from wsn_env.bluetooth.fitting import calibrate, fit_mixture, fit_path_loss, leave_one_out
from wsn_env.bluetooth.losses import advertisements, measure_losses
from wsn_env.bluetooth.packets import concatenate_tracks, held_out_residuals, local_deviation, residuals
from wsn_env.bluetooth.residual_map import CELL_M, residual_map, save_map
from wsn_env.cli import Calibrate, run_calibrate
from wsn_env.models.quantity import ScenarioError
from wsn_env.models.recordings import dataset
from wsn_env.models.recordings.calibration_file import CalibrationError, read_quantities
from wsn_env.models.recordings.dataset import Track, read_dataset
from wsn_env.models.recordings.receivers import Receivers
from wsn_env.models.recordings.replay import load_map
from wsn_env.reports import calibration_tables
from wsn_env.reports.calibration_tables import CALIBRATION_FILES

RECORDED = os.environ.get("WSN_BLE_DIR")
ROOM = Receivers(
    names=("a", "b", "c", "d", "e", "f"),
    positions_m=np.array([[1, 1, 2], [19, 2, 2], [18, 15, 1], [2, 14, 1], [10, 0.5, 2], [10, 15.5, 1]], float),
    limits_m=(20.0, 16.0),
)
AT_1M = np.array([-60.0, -57.0, -62.0, -55.0, -59.0, -64.0])
EXPONENTS = np.array([1.5, 1.9, 1.6, 2.1, 1.8, 1.7])
INTERVAL, LOSS, LOSS_AFTER_LOSS = 0.4548, 0.15, 0.25
FIELD, FIELD_M, DRIFT, DRIFT_S = 5.0, 0.8, 4.0, 7.0  # dB^2, m, dB^2, s
MAIN, MAIN_SD, SHARE, FADE, FADE_SD = 1.8, 2.9, 0.4, -2.7, 4.5

# What 200 simulated sets gave: sd of one set's estimate, of logarithms where it says so. The estimator's own bias was
# below a quarter of this for all of them.
SD = {"field_db2": 1.2, "log field_m": 0.39, "drift_db2": 0.88, "log drift_s": 0.5}
SD |= {"loss": 0.006, "loss_after_loss": 0.018}
SETS = 5


def walk(rng, seconds=80.0) -> tuple[np.ndarray, np.ndarray]:
    """Times (A,) and positions (A, 3) of a cart that drives from point to point at .35 m/s."""
    time = np.arange(0, seconds, INTERVAL)
    corners = rng.uniform([1, 1], [19, 15], (12, 2))
    way = np.append(0, np.cumsum(np.hypot(*np.diff(corners, axis=0).T)))
    x, y = (np.interp(0.35 * time, way, values) for values in corners.T)
    return time, np.stack([x, y, np.full(len(time), 1.8)], axis=1)


def simulate(rng, walks=None) -> list[Track]:
    """Tracks by the model that is calibrated: path loss, field, drift, white mixture, losses that come in bursts."""
    walks = [walk(rng) for _ in range(5)] if walks is None else walks
    count = len(ROOM.names)
    where = np.concatenate([position for _, position in walks])
    apart = np.hypot(*(where[:, None, :2] - where[:, :2]).transpose(2, 0, 1))
    root = np.linalg.cholesky(FIELD * np.exp(-apart / FIELD_M) + 1e-8 * np.eye(len(where)))
    field = np.split(root @ rng.normal(size=(len(where), count)), np.cumsum([len(time) for time, _ in walks])[:-1])
    tracks = []
    for number, ((time, position), static) in enumerate(zip(walks, field)):
        shape = len(time), count
        keep = np.exp(-INTERVAL / DRIFT_S)
        drift, lost = np.empty(shape), np.empty(shape, bool)
        drift[0], lost[0] = rng.normal(0, DRIFT**0.5, count), rng.random(count) < LOSS
        loss_after_none = LOSS * (1 - LOSS_AFTER_LOSS) / (1 - LOSS)
        for k in range(1, len(time)):
            drift[k] = keep * drift[k - 1] + rng.normal(0, ((1 - keep**2) * DRIFT) ** 0.5, count)
            lost[k] = rng.random(count) < np.where(lost[k - 1], LOSS_AFTER_LOSS, loss_after_none)
        fading = rng.random(shape) < SHARE
        white = np.where(fading, rng.normal(FADE, FADE_SD, shape), rng.normal(MAIN, MAIN_SD, shape))
        distance = np.linalg.norm(position[:, None] - ROOM.positions_m, axis=2)
        level = np.round(AT_1M - 10 * EXPONENTS * np.log10(distance) + static + drift + white)
        i, j = np.nonzero(~lost)
        tracks.append(track(f"walk{number}", time[i] + 1e-3 * j, j, level[i, j], position[i]))
    return tracks


def few() -> list[Track]:
    """Three short ones."""
    rng = np.random.default_rng(11)
    return simulate(rng, [walk(rng, 40) for _ in range(3)])


def track(name, time, receiver, level, position) -> Track:
    fields = dict(time_s=time, receiver=receiver, level_db=level, position_m=position)
    return Track(name=name, path=Path(f"{name}.mbd"), receivers=ROOM, counts={}, **fields)


@pytest.fixture(scope="module")
def sets() -> list[list[Track]]:
    return [simulate(np.random.default_rng(seed)) for seed in range(SETS)]


@pytest.fixture(scope="module")
def calibrations(sets) -> list[Calibration]:
    return [calibrate(tracks) for tracks in sets]


@pytest.fixture(scope="module")
def tracks() -> list[Track]:
    return few()


@pytest.fixture(scope="module")
def made(tracks) -> Calibration:
    return calibrate(tracks)


def mean_of(calibrations, figure) -> float:
    return float(np.mean([figure(calibration) for calibration in calibrations]))


def test_field_and_drift_are_told_apart(calibrations):
    truth = {"field_db2": FIELD, "field_m": FIELD_M, "drift_db2": DRIFT, "drift_s": DRIFT_S}
    for name, value in truth.items():
        size = np.log if f"log {name}" in SD else float
        sd = SD.get(name) or SD[f"log {name}"]
        found = mean_of(calibrations, lambda c, name=name, size=size: size(c.found["autocovariance_fit"][name]))
        assert abs(found - size(value)) < 3 * sd / SETS**0.5, name


def test_losses_come_in_bursts(calibrations):
    for name, value in (("loss", LOSS), ("loss_after_loss", LOSS_AFTER_LOSS)):
        found = mean_of(calibrations, lambda c, name=name: c.quantities[name])
        assert abs(found - value) < 3 * SD[name] / SETS**0.5
        assert found < 0.5
    assert calibrations[0].quantities["interval_s"] == pytest.approx(INTERVAL, abs=1e-3)


def test_lines_pass_where_the_packets_are(calibrations):
    """At 8 m, where most packets are: slopes drawn together cost little there. One set's sd is .58 dB a receiver."""
    decades = 10 * np.log10(8)
    truth = AT_1M - EXPONENTS * decades
    found = [np.array(c.quantities["at_1m_db"]) - decades * np.array(c.quantities["exponents"]) for c in calibrations]
    assert np.abs(np.mean(found, axis=0) - truth).max() < 3 * 0.58 / SETS**0.5
    common = mean_of(calibrations, lambda c: np.mean(c.quantities["exponents"]))
    assert common == pytest.approx(EXPONENTS.mean(), abs=3 * 0.135 / SETS**0.5)


def test_the_trackers_sds_are_what_the_autocovariance_says(calibrations):
    """1.2 c(.3 to 2 s), of which the lines take up .5 dB^2; the residuals' variance is parted without rest."""
    lags = INTERVAL * np.arange(1, 5)
    model = np.mean(FIELD * np.exp(-0.35 * lags / FIELD_M) + DRIFT * np.exp(-lags / DRIFT_S)) - 0.5
    assert mean_of(calibrations, lambda c: c.bias_db**2) == pytest.approx(1.2 * model, abs=3 * 0.79 / SETS**0.5)
    for c in calibrations:
        assert c.bias_db**2 + c.white_db**2 == pytest.approx(c.found["residual_db"] ** 2, abs=1e-4)
        assert c.bias_db == pytest.approx((1.2 * c.found["autocovariance_short_db2"]) ** 0.5, abs=1e-5)
        assert c.white_db == pytest.approx(c.found["white_db"], abs=1e-5)


def test_the_white_part_is_as_skewed_as_the_residuals(calibrations):
    """Third moments add up, and only the white part has one."""
    for c in calibrations:
        q = c.quantities
        moments = [m**3 + 3 * m * s**2 for m, s in ((q["main_db"], q["main_sd_db"]), (q["fade_db"], q["fade_sd_db"]))]
        white = (1 - q["fade_share"]) * moments[0] + q["fade_share"] * moments[1]
        assert white == pytest.approx(c.found["skewness"] * c.found["residual_db"] ** 3, rel=0.1, abs=2)
        assert (1 - q["fade_share"]) * q["main_db"] + q["fade_share"] * q["fade_db"] == pytest.approx(0, abs=1e-5)
        assert q["main_db"] > 0 > q["fade_db"]


def test_a_mixture_is_found_under_the_normal_part_that_hides_it():
    rng = np.random.default_rng(1)
    count, bias = 200_000, 9.0
    white = np.where(rng.random(count) < SHARE, rng.normal(FADE, FADE_SD, count), rng.normal(MAIN, MAIN_SD, count))
    residual = white + rng.normal(0, bias**0.5, count)
    found = fit_mixture(residual, bias, residual.var() - bias)
    truth = dict(main_db=MAIN, main_sd_db=MAIN_SD, fade_share=SHARE, fade_db=FADE, fade_sd_db=FADE_SD)
    for name, value in truth.items():
        assert found[name] == pytest.approx(value, rel=0.12), name


def test_one_normal_distribution_makes_no_trouble():
    residual = np.random.default_rng(2).normal(0, 5, 3000)
    found = fit_mixture(residual, 7.0, 18.0)
    main = 1 - found["fade_share"], found["main_db"], found["main_sd_db"]
    parts = main, (found["fade_share"], found["fade_db"], found["fade_sd_db"])
    assert sum(share * (mean**2 + sd**2) for share, mean, sd in parts) == pytest.approx(18)
    assert sum(share * mean for share, mean, _ in parts) == pytest.approx(0, abs=1e-9)


def test_exact_cells_give_back_what_made_them():
    lag_s, lag_m = np.meshgrid([0.5, 1, 2, 4, 8, 20, np.inf], [0, 0.3, 1, 2, 5], indexing="ij")
    truth = dict(field_db2=5.0, field_m=0.8, drift_db2=4.0, drift_s=7.0, taken_db2=0.4)
    cells = Autocovariance(lag_s, lag_m, bias_covariance(lag_s, lag_m, **truth), np.full(lag_s.shape, 500))
    assert fit_bias(cells) == pytest.approx(truth, rel=1e-4)


def test_lines_are_ridge_regression(tracks):
    """Against the normal equations of intercepts and slopes, the slopes drawn to that of a common one."""
    packets = concatenate_tracks(tracks)
    s, count = packets.receiver, len(ROOM.names)
    x = -10 * np.log10(packets.distance_m)
    one = (s[:, None] == np.arange(count)).astype(float)
    common = np.linalg.lstsq(np.column_stack([one, x]), packets.level_db, rcond=None)[0][-1]
    design = np.column_stack([one, one * x[:, None]])
    pull = np.repeat([0, 5.3**2 * 8 / 0.3**2], count)
    right = design.T @ packets.level_db + pull * common
    expected = np.linalg.solve(design.T @ design + np.diag(pull), right)
    assert np.concatenate(fit_path_loss(packets, ROOM.names)) == pytest.approx(expected, abs=1e-8)


def test_who_heard_which_advertisement():
    time = np.array([0.0, 0.01, 0.012, 0.5, 0.51, 1.0, 1.01, 2.0, 2.01, 2.5])
    receiver = np.array([0, 1, 1, 0, 2, 0, 1, 0, 1, 3])
    one = track("short", time, receiver, np.full(10, -60.0), np.ones((10, 3)))
    when, heard = advertisements(one)
    assert when == pytest.approx([0, 0.5, 1, 2])  # one receiver of six alone is no advertisement
    assert [list(np.flatnonzero(row)) for row in heard] == [[0, 1], [0, 2], [0, 1], [0, 1]]
    found = measure_losses([one])
    assert found["loss"] == pytest.approx(16 / 24)
    assert found["loss_after_loss"] == pytest.approx(6 / 8)  # receiver 2 comes, 1 comes; the gap of 1 s is no pair
    assert (found["interval_s"], found["advertisements_unheard"]) == (pytest.approx(0.5), 1)


def test_a_file_gives_back_the_calibration(made, tmp_path):
    part = replace(made, left_out="walk9")
    for one in (made, part):
        one.save(tmp_path / "c.json")
        assert Calibration.load(tmp_path / "c.json") == one
    assert calibrate(few()) == made


def broken(content: dict, *keys, value) -> dict:
    content = json.loads(json.dumps(content))
    inner = content
    for key in keys[:-1]:
        inner = inner[key]
    if value is None:
        del inner[keys[-1]]
    else:
        inner[keys[-1]] = value
    return content


@pytest.mark.parametrize(
    ("keys", "value", "words"),
    [
        (["kind"], "scenario", "kind = 'scenario'"),
        (["version"], 2, "version = 2"),
        (["tracks"], [], r"tracks = \[\]"),
        (["left_out"], "walk1", "left_out = 'walk1'"),
        (["found"], 3, "found = 3"),
        (["quantities", "field_db"], None, "quantities.field_db: is missing"),
        (["quantities", "feld_db"], 1.0, "quantities.feld_db = 1.0: unknown; did you mean field_db"),
        (["quantities", "field_db"], -1, "quantities.field_db = -1"),
        (["quantities", "loss"], float("nan"), "quantities.loss = nan"),
        (["quantities", "drift_s"], "7", "quantities.drift_s = '7'"),
        (["quantities", "exponents"], [1.5], r"quantities.exponents = \[1.5\]"),
        (["quantities", "exponents", 2], 0, r"quantities.exponents\[2\] = 0"),
        (["quantities", "positions", 1], [1, 2, 3], r"quantities.positions\[1\] = \[1, 2, 3\]"),
        (["quantities", "positions", 1, 0], "x", r"quantities.positions\[1\] = 'x'"),
        (["version"], 99, "version = 99: must be 1"),
        (["quantities", "lam"], 1e9, "quantities.lam = 1000000000.0: unknown"),
        (["quantities", "exponents", 0], -1.5, r"quantities.exponents\[0\] = -1.5: must be a finite number above 0"),
        (["quantities", "at_1m_db", 0], 1e300, r"quantities.at_1m_db\[0\] = 1e\+300: must be"),
        (["quantities", "heights_m", 0], 1e300, r"quantities.heights_m\[0\] = 1e\+300: must be"),
        (["quantities", "field_db"], 1e200, r"quantities.field_db = 1e\+200: must be"),
        (["quantities", "side_m"], 10**400, "quantities.side_m = 10000"),
        (["quantities", "drift_s"], "7" * 9999, "quantities.drift_s = '777"),
        (["quantities", "exponents"], ["1"] * 9999, r"quantities.exponents = \['1', "),
        (["tracks"], [{}] * 9999, r"tracks = \[{}, "),
    ],
)
def test_a_bad_file_is_told(made, tmp_path, keys, value, words):
    path = tmp_path / "c.json"
    made.save(path)
    path.write_text(json.dumps(broken(json.loads(path.read_text()), *keys, value=value)))
    with pytest.raises(CalibrationError, match=f"c.json: {words}") as problem:
        Calibration.load(path)
    assert len(str(problem.value)) < 400 + len(str(path)) and "\n" not in str(problem.value)
    with pytest.raises(ScenarioError, match=f"calibration = '.*c.json': is no file of `wsn calibrate`: {words}"):
        Scenario.named("Ble-v0", calibration=path)


def test_a_scenario_takes_the_quantities_of_a_file(made, tmp_path):
    path = tmp_path / "c.json"
    made.save(path)
    for encoding in ("utf-8", "utf-8-sig"):
        path.write_text(json.dumps(json.loads(path.read_text("utf-8"))), encoding=encoding)
        scenario = Scenario.named("Ble-v0", calibration=path)
        assert scenario.measurement.exponents == tuple(made.quantities["exponents"])
        assert scenario.field.positions == tuple(map(tuple, made.quantities["positions"]))


def test_no_file_and_no_json(tmp_path):
    with pytest.raises(CalibrationError, match="none.json: cannot be read"):
        Calibration.load(tmp_path / "none.json")
    for number, text in enumerate(("{", "[1]", "null", "", "[" * 100_000, '{"kind": 1, "kind": 2}', "\0", "9" * 5000)):
        path = tmp_path / f"{number}.json"
        path.write_text(text)
        for read in (Calibration.load, read_quantities):
            with pytest.raises(ValueError, match=f"{number}.json") as problem:
                read(path)
            assert len(str(problem.value)) < 300 + len(str(path)) and "\n" not in str(problem.value)
    for path in (tmp_path, "/dev/zero"):
        with pytest.raises(CalibrationError, match=f"{path}: cannot be read"):
            Calibration.load(path)


def test_tracks_that_cannot_be_calibrated(tracks):
    first = tracks[0]
    few = first.receiver != 2
    fields = ("time_s", "receiver", "level_db", "position_m")
    deaf = replace(first, **{name: getattr(first, name)[few] for name in fields})
    still = replace(first, position_m=np.full_like(first.position_m, 5.0))
    empty = replace(first, **{name: getattr(first, name)[:0] for name in fields})
    short = replace(first, **{name: getattr(first, name)[:30] for name in fields})
    moved = replace(tracks[1], receivers=replace(ROOM, positions_m=ROOM.positions_m + 1))
    for bad, words in (
        ([], "at least one"),
        ([first, first], "twice"),
        ([deaf], "receiver c: 0 packets"),
        ([still], "never changes"),
        ([empty], "no packet"),
        ([short], "too few"),
        ([first, moved], "track walk1: its receivers"),
    ):
        with pytest.raises(CalibrationError, match=words):
            calibrate(bad)
    distance = np.linalg.norm(first.position_m - ROOM.positions_m[first.receiver], axis=1)
    farther_louder = replace(first, level_db=-90 + 2 * distance)
    with pytest.raises(CalibrationError, match=r"tracks = \['walk0'\]: show no radio .* quantities.exponents\[0\] = -"):
        calibrate([farther_louder])
    with pytest.raises(CalibrationError, match="at least two"):
        leave_one_out([first])


def test_the_track_left_out_is_never_seen(tracks):
    """Other levels on a track change neither the calibration without it nor its map."""
    part = leave_one_out(tracks)[1]
    assert (part.left_out, part.tracks) == ("walk1", ("walk0", "walk2"))
    other = [tracks[0], replace(tracks[1], level_db=tracks[1].level_db[::-1] - 9), tracks[2]]
    assert leave_one_out(other)[1] == part
    assert np.array_equal(residual_map(tracks, part), residual_map(other, part))
    assert not np.array_equal(residual_map(tracks, calibrate(tracks)), residual_map(other, calibrate(other)))


def test_a_map_is_the_mean_of_a_gaussian_process(tracks, made):
    field = residual_map(tracks, made)
    assert (field.shape, field.dtype) == ((6, 80, 64), np.float32)
    packets = concatenate_tracks(tracks)
    residual = residuals(packets, made)
    cell = np.floor(packets.position_m[:, :2] / CELL_M)
    places = {}
    for k in np.flatnonzero(packets.receiver == 3):
        places.setdefault(tuple(cell[k]), []).append(k)
    place = np.array([packets.position_m[own, :2].mean(axis=0) for own in places.values()])
    mean = np.array([residual[own].mean() for own in places.values()])
    noise = np.array([3 + 18 / len(own) for own in places.values()])
    apart = np.linalg.norm(place[:, None] - place, axis=2)
    away = np.linalg.norm(place - [(20 + 0.5) * CELL_M, (31 + 0.5) * CELL_M], axis=1)
    expected = 5 * np.exp(-away / 1.5) @ np.linalg.solve(5 * np.exp(-apart / 1.5) + np.diag(noise), mean)
    assert field[3, 20, 31] == pytest.approx(expected, abs=1e-5)


def test_a_map_explains_a_track_it_never_saw():
    """The same way again and again: the field of the first walks is there on the last one, their drift is not."""
    rng = np.random.default_rng(5)
    again = simulate(rng, walks=[walk(rng)] * 5)
    part = leave_one_out(again)[4]
    packets = concatenate_tracks(again[4:])
    residual = residuals(packets, part)
    i, j = (packets.position_m[:, :2] / CELL_M).astype(int).T
    explained = residual - residual_map(again, part)[packets.receiver, i, j]
    assert explained.var() < residual.var() - 1


def test_a_map_is_kept_in_a_file(tmp_path):
    field = np.random.default_rng(0).normal(size=(2, 4, 3)).astype(np.float32)
    save_map(field, tmp_path / "m.npz")
    room_m = 4 * CELL_M, 3 * CELL_M
    assert np.array_equal(load_map(tmp_path / "m.npz", 2, room_m), field)
    assert np.array_equal(load_map(tmp_path / "m.npz", 2, (1.0 + 1e-9, 0.6)), field)  # a calibration rounds
    (tmp_path / "text.npz").write_text("no")
    (tmp_path / "cut.npz").write_bytes((tmp_path / "m.npz").read_bytes()[:-40])
    (tmp_path / "bad.npz").write_bytes(
        (tmp_path / "m.npz").read_bytes().replace(b"residual_db.npy", b"residual_db.npx")
    )
    np.savez(tmp_path / "pickle.npz", residual_db=np.array([{}], object), cell_m=CELL_M)
    np.savez(tmp_path / "other.npz", field=field)
    np.savez(tmp_path / "flat.npz", residual_db=field[0], cell_m=CELL_M)
    np.savez(tmp_path / "nan.npz", residual_db=field * np.float32(np.nan), cell_m=CELL_M)
    np.savez(tmp_path / "huge.npz", residual_db=field * np.float32(1e30), cell_m=CELL_M)
    np.savez(tmp_path / "cell.npz", residual_db=field, cell_m=0.5)
    np.savez(tmp_path / "double.npz", residual_db=field.astype(float), cell_m=CELL_M)
    np.savez(tmp_path / "receivers.npz", residual_db=np.repeat(field, 2, axis=0), cell_m=CELL_M)
    np.savez(tmp_path / "turned.npz", residual_db=field.transpose(0, 2, 1), cell_m=CELL_M)
    np.savez(tmp_path / "smaller.npz", residual_db=field[:, 1:], cell_m=CELL_M)
    np.save(tmp_path / "array.npy", field)
    names = "text cut bad pickle other flat nan huge cell double receivers turned smaller none".split()
    for name in (*(f"{name}.npz" for name in names), "array.npy", ""):
        with pytest.raises(ScenarioError, match=str(tmp_path / name)) as problem:
            load_map(tmp_path / name, 2, room_m)
        assert "\n" not in str(problem.value)
    with pytest.raises(ScenarioError, match=r"\(2, 4, 3\): must be float32 of shape \(12, 83, 71\), for 12"):
        World(Scenario.named("Ble-v0", residual_map=str(tmp_path / "m.npz"), particles=50))


def test_many_packets_are_taken_in_blocks(tracks, made, monkeypatch):
    """Of one track: the same but for rounding. Pairs of tracks are then of a part of the packets."""
    packets = concatenate_tracks(tracks[:1])
    residual = residuals(packets, made)
    whole = autocovariance(packets, residual)
    short, local = lagged_covariance(packets, residual, (0.3, 2.0)), local_deviation(packets, residual)
    monkeypatch.setattr(packets_module, "MOST_AT_ONCE", 30)
    assert np.bincount(packets.receiver).min() > 60
    blocks = autocovariance(packets, residual)
    np.testing.assert_array_equal(blocks.pairs, whole.pairs)
    np.testing.assert_allclose(blocks.covariance, whole.covariance, rtol=1e-9)
    assert lagged_covariance(packets, residual, (0.3, 2.0)) == pytest.approx(short, rel=1e-9)
    np.testing.assert_allclose(local_deviation(packets, residual), local, rtol=1e-6, atol=1e-9)
    both = autocovariance(concatenate_tracks(tracks[:2]), residuals(concatenate_tracks(tracks[:2]), made))
    assert 0 < both.pairs[-1].sum() <= len(made.quantities["exponents"]) * 30 * 30


def test_a_map_needs_the_tracks_of_its_calibration(tracks, made):
    with pytest.raises(CalibrationError, match="walk2 is missing"):
        residual_map(tracks[:2], made)


def test_the_command_writes_everything(tracks, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(dataset, "read_dataset", lambda folder: tracks)
    run_calibrate(Calibrate(tmp_path, tmp_path / "out", maps=True))
    stems = ["calibration", *(f"without_{one.name}" for one in tracks)]
    expected = {f"{stem}.{end}" for stem in stems for end in ("json", "npz")} | set(CALIBRATION_FILES)
    assert {path.name for path in (tmp_path / "out").iterdir()} == expected
    assert Calibration.load(tmp_path / "out" / "without_walk0.json").tracks == ("walk1", "walk2")
    printed = capsys.readouterr().out
    assert "field_db" in printed and "without_walk2.npz" in printed
    text = (tmp_path / "out" / "calibration.md").read_text()
    assert all(f"| {name} |" in text for name in (*ROOM.names, "walk0", "walk1", "walk2", "loss", "bias_s"))


def test_the_command_leaves_out_what_it_is_told(tracks, monkeypatch, tmp_path):
    monkeypatch.setattr(dataset, "read_dataset", lambda folder: tracks)
    monkeypatch.setattr(calibration_tables, "write_picture", lambda *_, **__: None)
    run_calibrate(Calibrate(tmp_path, tmp_path / "out", "walk1"))
    assert {path.name for path in (tmp_path / "out").glob("*.json")} == {"calibration.json", "without_walk1.json"}
    with pytest.raises(CalibrationError, match="'walk7': no such track; did you mean"):
        run_calibrate(Calibrate(tmp_path, tmp_path / "none", "walk7"))
    assert not (tmp_path / "none").exists()


def test_a_single_track_has_a_report(tracks, monkeypatch, tmp_path):
    monkeypatch.setattr(dataset, "read_dataset", lambda folder: tracks[:1])
    run_calibrate(Calibrate(tmp_path, tmp_path / "out"))
    assert "this calibration" in (tmp_path / "out" / "calibration.md").read_text()


@pytest.fixture(scope="module")
def recorded() -> list[Track]:
    if not RECORDED:
        pytest.skip("WSN_BLE_DIR names no folder of recorded tracks")
    return read_dataset(Path(RECORDED))


def test_the_recorded_tracks(recorded):
    """The six public tracks, against figures found by other means; tolerances are jackknife standard errors or less."""
    found = calibrate(recorded)
    q = found.quantities
    at_1m = [-60.1, -57.2, -58.8, -60.4, -61.8, -55.2, -64.3, -56.8, -61.3, -60.0, -56.7, -57.3]
    exponents = [1.57, 1.80, 1.56, 1.70, 1.58, 1.95, 1.93, 1.74, 1.34, 2.19, 1.29, 1.79]
    assert q["at_1m_db"] == pytest.approx(at_1m, abs=0.06)
    assert q["exponents"] == pytest.approx(exponents, abs=0.006)
    assert found.found["residual_db"] == pytest.approx(5.22, abs=0.01)
    assert (found.bias_db, found.white_db) == (pytest.approx(2.643, abs=0.002), pytest.approx(4.497, abs=0.002))
    assert q["bias_s"] == pytest.approx(5.13, abs=0.01)
    assert (q["loss"], q["loss_after_loss"]) == (pytest.approx(0.146, abs=0.001), pytest.approx(0.216, abs=0.002))
    assert q["interval_s"] == pytest.approx(0.4525, rel=0.006)
    assert (q["beacon_m"], q["side_m"], q["depth_m"]) == pytest.approx((1.82, 20.66, 17.64), abs=0.01)
    fitted = found.found["autocovariance_fit"]
    assert (fitted["field_db2"], fitted["field_m"]) == (pytest.approx(5, abs=1), pytest.approx(0.8, abs=0.2))
    assert (fitted["drift_db2"], fitted["drift_s"]) == (pytest.approx(4.1, abs=1.5), pytest.approx(7, abs=3))
    mixture = found.found["mixture_of_residuals"]  # scaled to the white variance of 18 there
    scale = (18.05 / found.white_db**2) ** 0.5
    scaled = [mixture[name] * scale for name in ("main_db", "main_sd_db", "fade_db", "fade_sd_db")]
    assert scaled == pytest.approx([1.8, 2.9, -2.7, 4.5], abs=0.06)
    assert q["fade_share"] == pytest.approx(0.4, abs=0.02)


def test_the_recorded_tracks_one_by_one(recorded):
    parts = leave_one_out(recorded)
    assert [part.left_out for part in parts] == [one.name for one in recorded]
    bias = [2.540, 2.709, 2.660, 2.642, 2.663, 2.595]
    white = [4.495, 4.500, 4.473, 4.490, 4.538, 4.503]
    assert [part.bias_db for part in parts] == pytest.approx(bias, abs=0.002)
    assert [part.white_db for part in parts] == pytest.approx(white, abs=0.002)
    held = held_out_residuals(recorded, calibrate(recorded), parts)
    assert held.residual_db.std() == pytest.approx(5.26, abs=0.05)
