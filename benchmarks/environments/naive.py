"""The implementation: system A's environment as one would first write it, after the paper and a textbook.

NumPy in double precision, NumPy's generator, Python loops over the members, one field at a time. The physics is that of
wsn_env's PreDC-v0 without the search for lost targets (so that it does less).
"""

import math

import numpy as np

from benchmarks.filters.problem import constant_velocity
from benchmarks.filters.textbook import ParticleFilter
from wsn_env.scenario import Scenario


class NaiveEnv:
    """reset(seed) and step(action) of a Gymnasium environment; the action is the number of members beside the head,
    who is the living node nearest to the predicted position."""

    def __init__(self, scenario: Scenario | None = None, candidates: int = 12, kind: type = ParticleFilter):
        self.scenario = scenario or Scenario.named("PreDC-v0")
        self.candidates = candidates
        self.kind = kind

    def reset(self, seed: int):
        """A new episode. Returns observation, info."""
        s = self.scenario
        self.rng = np.random.default_rng(seed)
        self.positions = self.rng.uniform(0, s.field.side_m, (s.field.nodes, 2))
        self.battery = np.full(s.field.nodes, s.radio.battery_j)
        self.period, self.head, self.members = 0, None, []
        self.track = self._draw_track()
        self.target = self.track[0]
        sds = np.array([s.tracking.start_sd_m, s.tracking.start_sd_ms] * 2)
        mean = self.target + sds * self.rng.normal(size=4)
        particles = mean + sds * self.rng.normal(size=(s.tracking.particles, 4))
        self.filter = self.kind(particles, s.period_s, s.filter_q, s.measurement.noise_m, self.rng)
        self.mean, self.cov = mean, np.diag(sds**2)
        return self._observe(), {}

    def step(self, action: int):
        """One period. Returns observation, reward, terminated, truncated, info."""
        s = self.scenario
        self.energy = 0.0
        self._form(self._nearest(1 + action))
        self.target = self.track[self.period + 1]
        reports = self._collect_reports()
        self.filter.predict()
        self.filter.weigh(reports)
        self.mean, self.cov = self.filter.estimate()
        if self.filter.effective_size() < s.tracking.resample_below * s.tracking.particles:
            self.filter.resample()
            self._broadcast()
        self.period += 1
        error = math.hypot(self.mean[0] - self.target[0], self.mean[2] - self.target[2])
        energy_mj = 1e3 * self.energy
        info = {"error_m": error, "energy_mj": energy_mj}
        return self._observe(), -(error + s.lam * energy_mj), False, self.period >= s.periods, info

    def _draw_track(self) -> np.ndarray:
        """The crossing (periods + 1, 4): the first that stays in the field."""
        s = self.scenario
        low, high = s.motion.margin_m, s.field.side_m - s.motion.margin_m
        while True:
            start, end = self.rng.uniform(low, high, 2), self.rng.uniform(low, high, 2)
            if np.linalg.norm(end - start) >= s.motion.crossing_m:
                break
        velocity = (end - start) / (s.periods * s.period_s)
        transition, noise_gain = constant_velocity(s.period_s)
        while True:
            track = [np.array([start[0], velocity[0], start[1], velocity[1]])]
            for _ in range(s.periods):
                acceleration = self.rng.normal(0, s.motion.acceleration_ms2, 2)
                track.append(transition @ track[-1] + noise_gain @ acceleration)
            track = np.array(track)
            if track[:, [0, 2]].min() >= 0 and track[:, [0, 2]].max() <= s.field.side_m:
                return track

    def _nearest(self, count: int) -> list[int]:
        predicted = (self.filter.transition @ self.mean)[[0, 2]]
        distances = np.linalg.norm(self.positions - predicted, axis=1)
        distances[self.battery <= 0] = np.inf
        return [int(node) for node in np.argsort(distances)[:count] if np.isfinite(distances[node])]

    def _form(self, cluster: list[int]) -> None:
        """Handover to a new head, invitations to new members."""
        radio = self.scenario.radio
        head, members = cluster[0], sorted(cluster[1:])
        changed = head != self.head
        if changed and self.head is not None:
            self._send(self.head, head, self.scenario.handover_bits)
        for node in members:
            if changed or node not in self.members:
                self._send(head, node, radio.invitation_bits)
        self.head, self.members = head, members

    def _collect_reports(self) -> list[np.ndarray]:
        s = self.scenario
        position = self.target[[0, 2]]
        reports = []
        for node in [self.head, *self.members]:
            distance = np.linalg.norm(self.positions[node] - position)
            if self.rng.random() < self._detection_probability(distance):
                if node != self.head:
                    self._send(node, self.head, s.radio.report_bits)
                reports.append(position + self.rng.normal(0, s.measurement.noise_m, 2))
        return reports

    def _detection_probability(self, distance: float) -> float:
        """Eqs. 2-3."""
        d = self.scenario.detection
        inner, outer = (1 - d.softness) * d.radius_m, (1 + d.softness) * d.radius_m
        if distance <= inner:
            return d.ceiling
        if distance >= outer:
            return 0.0
        return d.ceiling * math.exp(-d.decay * (distance - inner) ** d.decay_power / (outer - distance) ** d.edge_power)

    def _send(self, sender: int, receiver: int, bits: int) -> None:
        """One packet (eq. 5)."""
        distance = np.linalg.norm(self.positions[sender] - self.positions[receiver])
        self._transmit(sender, distance, bits)
        self._receive(receiver, bits)

    def _transmit(self, node: int, distance: float, bits: int) -> None:
        radio = self.scenario.radio
        self._spend(node, bits * (1e-9 * radio.tx_nj_per_bit + 1e-12 * radio.amplifier_pj_per_bit_m2 * distance**2))

    def _receive(self, node: int, bits: int) -> None:
        self._spend(node, bits * 1e-9 * self.scenario.radio.rx_nj_per_bit)

    def _spend(self, node: int, joules: float) -> None:
        paid = min(joules, self.battery[node])
        self.battery[node] -= paid
        self.energy += paid

    def _broadcast(self) -> None:
        """The head tells its members to resample."""
        bits = self.scenario.radio.broadcast_bits
        if self.members:
            farthest = max(np.linalg.norm(self.positions[node] - self.positions[self.head]) for node in self.members)
            self._transmit(self.head, farthest, bits)
            for node in self.members:
                self._receive(node, bits)

    def _observe(self) -> np.ndarray:
        """Belief, and the candidates' offsets, detection probabilities, batteries and roles."""
        features = [*self.mean, *self.cov.ravel()]
        predicted = (self.filter.transition @ self.mean)[[0, 2]]
        for node in self._nearest(self.candidates):
            offset = self.positions[node] - predicted
            distance = np.linalg.norm(offset)
            features += [*offset, distance, self._detection_probability(distance), self.battery[node]]
            features += [node == self.head, node in self.members]
        return np.array(features, dtype=np.float32)
