"""How the target moves: a motion is a function from a key to a whole track.

The track of an episode does not depend on what the network does, so it is drawn at the start: (periods + 1, 4)
true states (x, vx, y, vy) in m and m/s. All tracks stay inside the field.
"""

from dataclasses import fields

import numpy as np

from wsn_env.compiled import draws
from wsn_env.compiled.elementary import HALF_PI, sincos
from wsn_env.compiled.kernels import lean_piece, piece
from wsn_env.models.physics.recordings import read_track, replayed_track, walk_legs
from wsn_env.models.quantity import ScenarioError
from wsn_env.models.sections import MOTIONS, Legs, Recorded, Replay
from wsn_env.scenario import Scenario

CROSSING, STRAIGHT, SINE, CIRCLE, TURNS, WAYPOINT, CRUISE, RECORDED, LEGS, WALK, REPLAY = range(len(MOTIONS))
ROUGHENING_M = 0.05  # what a walker's position is uncertain by beside its velocity
CROSSING_TRIES = 100
CRUISE_TRIES = 1000
CODES = dict(zip(MOTIONS.values(), range(len(MOTIONS))))


def motion_parameters(scenario: Scenario) -> tuple[int, np.ndarray, np.ndarray]:
    """A scenario's motion for `draw_track`: its code, its numbers (4,), its recordings (N, periods + 1, 4)."""
    motion = scenario.motion
    numbers = np.zeros(4)
    recordings = np.zeros((1, scenario.periods + 1, 4))
    if isinstance(motion, Recorded):
        recordings = np.stack([read_track(path, scenario) for path in motion.tracks])
    elif isinstance(motion, Legs):
        recordings = walk_legs(scenario)[None]
    elif isinstance(motion, Replay):
        recordings = replayed_track(scenario)[None]
    else:
        values = [getattr(motion, item.name) for item in fields(motion)]
        numbers[: len(values)] = values
    _check_room(scenario)
    return CODES[type(motion)], numbers, recordings


def _check_room(scenario: Scenario) -> None:
    motion, side = scenario.motion, scenario.field.side_m
    name = type(motion).__name__
    if name == "Crossing":
        room = (side - 2 * motion.margin_m) * 2**0.5
        if room <= 0:
            raise ScenarioError(f"Crossing.margin_m = {motion.margin_m}: must be below half the side, {side / 2} m")
        if motion.crossing_m > 0.9 * room:
            raise ScenarioError(
                f"Crossing.crossing_m = {motion.crossing_m}: must be at most {0.9 * room:.1f} m in a field of {side} m"
                f" with a margin of {motion.margin_m} m"
            )
    if name == "Cruise":
        if motion.inset_m < motion.margin_m or motion.inset_m >= side / 2:
            raise ScenarioError(
                f"Cruise.inset_m = {motion.inset_m}: must be at least margin_m = {motion.margin_m} and below half the"
                f" side, {side / 2} m"
            )
        room = side - motion.inset_m - motion.margin_m
        fastest = room / (scenario.periods * scenario.period_s)
        if motion.speed_ms > fastest:
            raise ScenarioError(
                f"Cruise.speed_ms = {motion.speed_ms}: must be at most {fastest:.4g} m/s, from the inner field to the"
                f" margin in {scenario.periods} periods"
            )
    if name == "Walk":
        room = min(scenario.field.room_m)
        if motion.margin_m >= room / 2:
            raise ScenarioError(f"Walk.margin_m = {motion.margin_m}: must be below half the room, {room / 2} m")
        if motion.fastest_ms * scenario.period_s > room:
            raise ScenarioError(
                f"Walk.fastest_ms = {motion.fastest_ms}: must be at most {room / scenario.period_s} m/s"
            )
    if name in ("Turns", "Waypoint") and motion.speed_ms * scenario.period_s > side:
        raise ScenarioError(
            f"{name}.speed_ms = {motion.speed_ms}: must be at most {side / scenario.period_s} m/s, a side of the field"
            " in a period"
        )
    if name in ("Sine", "Circle") and motion.turn_s < scenario.period_s:
        raise ScenarioError(f"{name}.turn_s = {motion.turn_s}: must be at least a period, {scenario.period_s} s")
    if name == "Circle" and motion.circle_m > side / 2:
        raise ScenarioError(f"Circle.circle_m = {motion.circle_m}: must be at most half the side, {side / 2} m")
    if name == "Sine" and motion.amplitude_m > side / 2:
        raise ScenarioError(f"Sine.amplitude_m = {motion.amplitude_m}: must be at most half the side, {side / 2} m")


@piece
def draw_track(code, numbers, recordings, stream, period_s, side_m, depth_m, track):
    """Fill `track` (periods + 1, 4) with the true states."""
    if code == CROSSING:
        _cross(stream, numbers[0], numbers[1], numbers[2], period_s, side_m, track)
    elif code == STRAIGHT:
        _go_straight(numbers[0], numbers[1], period_s, track)
    elif code == SINE:
        _swing(numbers[0], numbers[1], numbers[2], period_s, side_m, track)
    elif code == CIRCLE:
        _circle(numbers[0], numbers[1], period_s, side_m, track)
    elif code == TURNS:
        _turn(stream, numbers[0], numbers[1], period_s, side_m, track)
    elif code == WAYPOINT:
        _visit(stream, numbers[0], period_s, side_m, track)
    elif code == CRUISE:
        _cruise(stream, numbers[0], numbers[1], numbers[2], numbers[3], period_s, side_m, track)
    elif code == WALK:
        _walk(stream, numbers[0], numbers[1], numbers[2], period_s, side_m, depth_m, track)
    else:  # recorded, or of straight legs
        track[:] = recordings[int(draws.uniform(stream, 0) * len(recordings))]
    for state in track:
        _reflect(state, 0, side_m)
        _reflect(state, 2, depth_m)


@piece
def _reflect(state, axis, side_m):
    """Fold a coordinate back into [0, side], as a mirror at the border would."""
    x = state[axis] - 2.0 * side_m * np.floor(state[axis] / (2.0 * side_m))
    if x > side_m:
        x = 2.0 * side_m - x
        state[axis + 1] = -state[axis + 1]
    state[axis] = min(max(x, 0.0), side_m)


@piece
def advance(state, period_s, ax, ay, out):
    """Constant velocity with a constant acceleration over the period: F x + G a (eqs. 6, 8)."""
    half = 0.5 * period_s * period_s
    out[0] = state[0] + period_s * state[1] + half * ax
    out[1] = state[1] + period_s * ax
    out[2] = state[2] + period_s * state[3] + half * ay
    out[3] = state[3] + period_s * ay


@lean_piece
def predict_moments(mean, cov, t, q, predicted_mean, predicted_cov):
    """F x and F P F' + q^2 G G' (eq. 16).

    Differs from the paper: as printed, eq. 16 leaves out the spread of the particles, so that E would be constant.
    """
    for i in range(4):
        predicted_mean[i] = mean[i] + (t * mean[i + 1] if i % 2 == 0 else 0.0)
    predict_covariance(cov, t, q, predicted_cov)


@lean_piece
def predict_covariance(cov, t, q, predicted_cov):
    """F P F' + q^2 G G'; also in place, since every entry is made of itself and of later ones."""
    for i in range(4):
        for j in range(4):
            p = cov[i, j]
            if i % 2 == 0:
                p += t * cov[i + 1, j]
            if j % 2 == 0:
                p += t * cov[i, j + 1]
                if i % 2 == 0:
                    p += t * t * cov[i + 1, j + 1]
            predicted_cov[i, j] = max(p, 0.0) if i == j else p
    gain = (0.5 * t * t, t)
    for axis in (0, 2):
        for i in range(2):
            for j in range(2):
                predicted_cov[axis + i, axis + j] += q * q * gain[i] * gain[j]


@lean_piece
def predict_walk(mean, cov, c, predicted_mean, predicted_cov):
    """F x and F P F' + Q of a walker: v' = a v + sd sqrt(1 - a^2) e, x' = x + T (v + v') / 2; without walls."""
    a, half = c.velocity_kept, 0.5 * c.period_s
    way = half * (1.0 + a)
    variance = (1.0 - a * a) * c.velocity_sd * c.velocity_sd
    noise = (half * half * variance + ROUGHENING_M * ROUGHENING_M, half * variance, variance)
    for axis in (0, 2):
        predicted_mean[axis] = mean[axis] + way * mean[axis + 1]
        predicted_mean[axis + 1] = a * mean[axis + 1]
        for other in (0, 2):
            pp, pv, vp, vv = cov[axis, other], cov[axis, other + 1], cov[axis + 1, other], cov[axis + 1, other + 1]
            predicted_cov[axis, other] = pp + way * (pv + vp) + way * way * vv
            predicted_cov[axis, other + 1] = a * (pv + way * vv)
            predicted_cov[axis + 1, other] = a * (vp + way * vv)
            predicted_cov[axis + 1, other + 1] = a * a * vv
        predicted_cov[axis, axis] += noise[0]
        predicted_cov[axis, axis + 1] += noise[1]
        predicted_cov[axis + 1, axis] += noise[1]
        predicted_cov[axis + 1, axis + 1] += noise[2]


@piece
def _cross(stream, margin_m, crossing_m, acceleration_ms2, period_s, side_m, track):
    steps = len(track) - 1
    inner = side_m - 2.0 * margin_m
    draw = 0
    while True:  # the first pair of points that lie far enough apart
        x0 = margin_m + inner * draws.uniform(stream, draw)
        y0 = margin_m + inner * draws.uniform(stream, draw + 1)
        x1 = margin_m + inner * draws.uniform(stream, draw + 2)
        y1 = margin_m + inner * draws.uniform(stream, draw + 3)
        if (x1 - x0) ** 2 + (y1 - y0) ** 2 >= crossing_m**2:
            break
        draw += 4
    duration = steps * period_s
    track[0] = np.array((x0, (x1 - x0) / duration, y0, (y1 - y0) / duration))
    for attempt in range(CROSSING_TRIES + 1):  # the first noise that keeps the target in the field; at last none
        sd = acceleration_ms2 if attempt < CROSSING_TRIES else 0.0
        inside = True
        for k in range(steps):
            ax, ay = draws.normal_pair(stream, 1_000_000 + attempt * steps + k)
            advance(track[k], period_s, sd * ax, sd * ay, track[k + 1])
            inside &= 0.0 <= track[k + 1, 0] <= side_m and 0.0 <= track[k + 1, 2] <= side_m
        if inside:
            return


@piece
def _go_straight(from_m, velocity_ms, period_s, track):
    for k in range(len(track)):
        x = from_m + velocity_ms * period_s * k
        track[k] = np.array((x, velocity_ms, x, velocity_ms))


@piece
def _swing(speed_ms, amplitude_m, turn_s, period_s, side_m, track):
    w = 4.0 * HALF_PI / turn_s
    for k in range(len(track)):
        t = k * period_s
        s, c = sincos(w * t)
        track[k] = np.array((0.05 * side_m + speed_ms * t, speed_ms, side_m / 2 + amplitude_m * s, amplitude_m * w * c))


@piece
def _circle(circle_m, turn_s, period_s, side_m, track):
    w = 4.0 * HALF_PI / turn_s
    for k in range(len(track)):
        s, c = sincos(w * k * period_s)
        track[k] = np.array((side_m / 2 + circle_m * c, -circle_m * w * s, side_m / 2 + circle_m * s, circle_m * w * c))


@piece
def _turn(stream, speed_ms, turn_probability, period_s, side_m, track):
    track[0, 0] = side_m * (0.1 + 0.8 * draws.uniform(stream, 0))
    track[0, 2] = side_m * (0.1 + 0.8 * draws.uniform(stream, 1))
    heading = 4.0 * HALF_PI * draws.uniform(stream, 2)
    for k in range(len(track)):
        if k > 0:
            if draws.uniform(stream, 2 * k + 1) < turn_probability:
                heading += 2.0 * HALF_PI * (draws.uniform(stream, 2 * k + 2) - 0.5)
            advance(track[k - 1], period_s, 0.0, 0.0, track[k])
        s, c = sincos(heading)
        if track[k, 0] < 0.0 or track[k, 0] > side_m:  # the mirror turns the heading too
            c = -c
        if track[k, 2] < 0.0 or track[k, 2] > side_m:
            s = -s
        _reflect(track[k], 0, side_m)
        _reflect(track[k], 2, side_m)
        heading = _heading(s, c)
        track[k, 1] = speed_ms * c
        track[k, 3] = speed_ms * s


@piece
def _heading(s, c):
    """The angle in (-pi, pi] of a unit vector, by Newton's steps from the octant (no libm)."""
    angle = 0.0
    if c < 0.0:
        angle = 2.0 * HALF_PI if s >= 0.0 else -2.0 * HALF_PI
    if abs(s) > abs(c):
        angle = HALF_PI if s >= 0.0 else -HALF_PI
    for _ in range(6):
        si, co = sincos(angle)
        angle += s * co - c * si
    return angle


@piece
def _visit(stream, speed_ms, period_s, side_m, track):
    x = side_m * draws.uniform(stream, 0)
    y = side_m * draws.uniform(stream, 1)
    goal_x = side_m * draws.uniform(stream, 2)
    goal_y = side_m * draws.uniform(stream, 3)
    draw = 4
    for k in range(len(track)):
        if k > 0:
            left = speed_ms * period_s
            while True:
                distance = np.sqrt((goal_x - x) ** 2 + (goal_y - y) ** 2)
                if distance > left:
                    x += (goal_x - x) * left / distance
                    y += (goal_y - y) * left / distance
                    break
                left -= distance
                x, y = goal_x, goal_y
                goal_x = side_m * draws.uniform(stream, draw)
                goal_y = side_m * draws.uniform(stream, draw + 1)
                draw += 2
        distance = np.sqrt((goal_x - x) ** 2 + (goal_y - y) ** 2)
        scale = speed_ms / distance if distance > 0.0 else 0.0
        track[k] = np.array((x, scale * (goal_x - x), y, scale * (goal_y - y)))


@piece
def _walk(stream, slowest_ms, fastest_ms, margin_m, period_s, side_m, depth_m, track):
    width, depth = side_m - 2.0 * margin_m, depth_m - 2.0 * margin_m
    x = margin_m + width * draws.uniform(stream, 0)
    y = margin_m + depth * draws.uniform(stream, 1)
    goal_x, goal_y, speed, draw = x, y, 1.0, 2
    for k in range(len(track)):
        left = period_s if k > 0 else 0.0  # s
        while True:
            distance = np.sqrt((goal_x - x) ** 2 + (goal_y - y) ** 2)
            if distance > left * speed:
                x += (goal_x - x) * left * speed / distance
                y += (goal_y - y) * left * speed / distance
                break
            left -= distance / speed
            x, y = goal_x, goal_y
            goal_x = margin_m + width * draws.uniform(stream, draw)
            goal_y = margin_m + depth * draws.uniform(stream, draw + 1)
            speed = slowest_ms + (fastest_ms - slowest_ms) * draws.uniform(stream, draw + 2)
            draw += 3
        distance = np.sqrt((goal_x - x) ** 2 + (goal_y - y) ** 2)
        scale = speed / distance if distance > 0.0 else 0.0
        track[k] = np.array((x, scale * (goal_x - x), y, scale * (goal_y - y)))


@piece
def _cruise(stream, speed_ms, acceleration_ms2, inset_m, margin_m, period_s, side_m, track):
    steps = len(track) - 1
    inner, first = side_m - 2.0 * inset_m, 0
    for attempt in range(2 * CRUISE_TRIES):  # the first that stays inside; after CRUISE_TRIES without noise
        sd = acceleration_ms2 if attempt < CRUISE_TRIES else 0.0
        s, c = sincos(4.0 * HALF_PI * draws.uniform(stream, first + 2))
        x, y = inset_m + inner * draws.uniform(stream, first), inset_m + inner * draws.uniform(stream, first + 1)
        track[0] = np.array((x, speed_ms * c, y, speed_ms * s))
        inside = True
        for k in range(steps):
            ax, ay = draws.normal_pair(stream, first // 2 + 2 + k)
            advance(track[k], period_s, sd * ax, sd * ay, track[k + 1])
            inside &= margin_m <= track[k + 1, 0] <= side_m - margin_m
            inside &= margin_m <= track[k + 1, 2] <= side_m - margin_m
        if inside:
            return
        first += 4 + 2 * steps
