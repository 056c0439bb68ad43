"""The same environment in JAX, as its users would write it: one field's reset and period as functions without side
effects, mapped over the rows and compiled. float32. All rows begin together, since all episodes are of one length.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.environments import FURTHER
from benchmarks.filters.problem import constant_velocity
from wsn_env.scenario import Scenario

CANDIDATES = 12


class Field(NamedTuple):
    """The state of a row."""

    key: jax.Array
    positions: jax.Array  # (S, 2) m
    battery: jax.Array  # (S,) J
    head: jax.Array  # -1: none yet
    member: jax.Array  # (S,) bool
    track: jax.Array  # (T + 1, 4) x, vx, y, vy
    particles: jax.Array  # (4, P)
    log_weights: jax.Array  # (P,)
    mean: jax.Array  # (4,)
    cov: jax.Array  # (4, 4)


class Period(NamedTuple):
    """What a step gives, as NumPy arrays."""

    observations: np.ndarray  # (B, n); of new episodes, if all rows have ended
    reward: np.ndarray  # (B,)
    ends: bool  # all rows
    last: np.ndarray  # (B, n) observations of the period
    error_m: np.ndarray  # (B,)
    energy_mj: np.ndarray  # (B,)


class JaxFields:
    """B fields: `reset(seed)` and `step(actions)` of a vector environment."""

    def __init__(self, rows: int, scenario: Scenario):
        jax.config.update("jax_platforms", "cpu")
        self.scenario, self.rows = scenario, rows
        reset, step = functions(self.scenario)
        self._reset, self._step = jax.jit(jax.vmap(reset)), jax.jit(jax.vmap(step, in_axes=(0, 0, None)))

    def reset(self, seed: int) -> np.ndarray:
        """New episodes. Returns the observations (B, n)."""
        self._key = jax.random.key(seed)
        return self._begin()

    def _begin(self) -> np.ndarray:
        self._key, own = jax.random.split(self._key)
        self.fields, observations = self._reset(jax.random.split(own, self.rows))
        self.period = 0
        return np.asarray(observations)

    def step(self, actions: np.ndarray) -> Period:
        """One period."""
        self.fields, *found = self._step(self.fields, jnp.asarray(actions), self.period)
        last, reward, error, energy = (np.asarray(each) for each in found)
        self.period += 1
        ends = self.period >= self.scenario.periods
        return Period(self._begin() if ends else last, reward, ends, last, error, energy)


def functions(s: Scenario):
    """A row's reset(key) and step(field, action, period), for `jax.vmap`."""
    transition, gain = (jnp.asarray(each, jnp.float32) for each in constant_velocity(s.period_s))
    count, radio, detection, t = s.tracking.particles, s.radio, s.detection, s.period_s
    inner, outer = (1 - detection.softness) * detection.radius_m, (1 + detection.softness) * detection.radius_m
    tx, amplifier, rx = 1e-9 * radio.tx_nj_per_bit, 1e-12 * radio.amplifier_pj_per_bit_m2, 1e-9 * radio.rx_nj_per_bit

    def chance(distance):
        """Eqs. 2-3."""
        reach = jnp.clip(distance, inner, outer - 1e-6)
        fall = detection.decay * (reach - inner) ** detection.decay_power / (outer - reach) ** detection.edge_power
        return jnp.where(distance >= outer, 0.0, detection.ceiling * jnp.exp(-fall))

    def crossing(key):
        """The track (T + 1, 4)."""
        low, high = s.motion.margin_m, s.field.side_m - s.motion.margin_m

        def ends(key):
            return jax.random.uniform(key, (2, 2), minval=low, maxval=high)

        def short(carry):
            a, b = ends(carry[1])
            return jnp.hypot(*(b - a)) < s.motion.crossing_m

        key, own = jax.random.split(key)
        key, own = jax.lax.while_loop(short, lambda carry: tuple(jax.random.split(carry[0])), (key, own))
        start, end = ends(own)
        velocity = (end - start) / (s.periods * t)
        first = jnp.stack([start[0], velocity[0], start[1], velocity[1]])

        def draw(key):
            accelerations = s.motion.acceleration_ms2 * jax.random.normal(key, (s.periods, 2))

            def move(x, a):
                x = transition @ x + gain @ a
                return x, x

            return jnp.concatenate([first[None], jax.lax.scan(move, first, accelerations)[1]])

        def leaves(carry):
            place = carry[1][:, ::2]
            return (place.min() < 0) | (place.max() > s.field.side_m)

        def again(carry):
            key, own = jax.random.split(carry[0])
            return key, draw(own)

        return jax.lax.while_loop(leaves, again, again((key, None)))[1]

    def nearest(f, how_many):
        """Living nodes nearest to the prediction, and their distances; inf: dead."""
        predicted = (transition @ f.mean)[::2]
        distances = jnp.where(f.battery > 0, jnp.hypot(*(f.positions - predicted).T), jnp.inf)
        near, nodes = jax.lax.top_k(-distances, how_many)
        return predicted, nodes, -near

    def observe(f):
        predicted, nodes, distances = nearest(f, CANDIDATES)
        offsets = f.positions[nodes] - predicted
        rest = [distances, chance(distances), f.battery[nodes], nodes == f.head, f.member[nodes]]
        table = jnp.column_stack([offsets, *rest])
        return jnp.concatenate([f.mean, f.cov.ravel(), table.ravel()]).astype(jnp.float32)

    def reset(key):
        key, for_nodes, for_track, for_mean, for_particles = jax.random.split(key, 5)
        track = crossing(for_track)
        sds = jnp.array([s.tracking.start_sd_m, s.tracking.start_sd_ms] * 2)
        mean = track[0] + sds * jax.random.normal(for_mean, (4,))
        f = Field(
            key,
            jax.random.uniform(for_nodes, (s.field.nodes, 2), maxval=s.field.side_m),
            jnp.full(s.field.nodes, radio.battery_j, jnp.float32),
            jnp.int32(-1),
            jnp.zeros(s.field.nodes, bool),
            track,
            mean[:, None] + sds[:, None] * jax.random.normal(for_particles, (4, count)),
            jnp.full(count, -jnp.log(count)),
            mean,
            jnp.diag(sds**2),
        )
        return f, observe(f)

    def step(f, action, period):
        key, for_detection, for_noise, for_motion, for_slot = jax.random.split(f.key, 5)
        # Handover to a new head, invitations to new members (eq. 5).
        _, nodes, distances = nearest(f, 1 + FURTHER)
        head = nodes[0]
        chosen = (jnp.arange(1 + FURTHER) <= action) & jnp.isfinite(distances)
        members = chosen.at[0].set(False)
        to_head = jnp.sum((f.positions[nodes] - f.positions[head]) ** 2, axis=1)
        changed = head != f.head
        cost = jnp.zeros(s.field.nodes)
        handover = changed & (f.head >= 0)
        way = jnp.sum((f.positions[f.head] - f.positions[head]) ** 2)
        cost = cost.at[f.head].add(handover * s.handover_bits * (tx + amplifier * way))
        cost = cost.at[head].add(handover * s.handover_bits * rx)
        invited = members & (changed | ~f.member[nodes])
        cost = cost.at[head].add(jnp.sum(invited * radio.invitation_bits * (tx + amplifier * to_head)))
        cost = cost.at[nodes].add(invited * radio.invitation_bits * rx)
        # Reports.
        target = f.track[period + 1, ::2]
        away = jnp.hypot(*(f.positions[nodes] - target).T)
        reported = chosen & (jax.random.uniform(for_detection, away.shape) < chance(away))
        sent = reported & members
        cost = cost.at[nodes].add(sent * radio.report_bits * (tx + amplifier * to_head))
        cost = cost.at[head].add(jnp.sum(sent) * radio.report_bits * rx)
        values = target + s.measurement.noise_m * jax.random.normal(for_noise, (1 + FURTHER, 2))
        # The filter.
        a = s.filter_q * jax.random.normal(for_motion, (2, count))
        x = transition @ f.particles + gain @ a
        squares = (x[0] - values[:, :1]) ** 2 + (x[2] - values[:, 1:]) ** 2
        log_weights = f.log_weights - 0.5 / s.measurement.noise_m**2 * jnp.sum(squares * reported[:, None], axis=0)
        log_weights = jax.nn.log_softmax(log_weights)
        w = jnp.exp(log_weights)
        mean = x @ w
        deviation = x - mean[:, None]
        cov = (deviation * w) @ deviation.T
        resamples = 1 / (w @ w) < s.tracking.resample_below * count
        cumulated = jnp.cumsum(w)
        slots = cumulated[:-1] * (count / cumulated[-1]) - jax.random.uniform(for_slot) + 1
        ends = jnp.zeros(count + 1, jnp.int32).at[jnp.clip(slots, 0, count).astype(jnp.int32)].add(1)
        parents = jnp.cumsum(ends)[:count]
        x = jnp.where(resamples, x[:, parents], x)
        log_weights = jnp.where(resamples, -jnp.log(count), log_weights)
        # The head tells its members to resample.
        farthest = jnp.max(to_head * members)
        tells = resamples & members.any()
        cost = cost.at[head].add(tells * radio.broadcast_bits * (tx + amplifier * farthest))
        cost = cost.at[nodes].add(tells * members * radio.broadcast_bits * rx)
        paid = jnp.minimum(cost, f.battery)
        member = jnp.zeros(s.field.nodes, bool).at[nodes].set(members)
        f = Field(key, f.positions, f.battery - paid, head, member, f.track, x, log_weights, mean, cov)
        error, energy = jnp.hypot(*(mean[::2] - target)), 1e3 * jnp.sum(paid)
        return f, observe(f), -(error + s.lam * energy), error, energy

    return reset, step
