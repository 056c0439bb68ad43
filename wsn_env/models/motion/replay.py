"""A recorded walk with a beacon."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from wsn_env.models.motion.recorded import RecordedMotion
from wsn_env.models.quantity import ScenarioError, described
from wsn_env.models.recordings.receivers import OUTSIDE_M, in_room
from wsn_env.models.recordings.replay import periods_of, receivers_of, recorded

if TYPE_CHECKING:
    from wsn_env.models.measurement.base import Measurement
    from wsn_env.scenario import Scenario

SAME_PLACE_M = 0.05  # of a receiver, in two files


@dataclass(frozen=True)
class Replay(RecordedMotion):
    """A recorded walk with a beacon, and the packets that were recorded with it; nothing else reaches the tracker.

    A file of the published format, see `wsn_env.models.recordings`. The target's position in a period is the mean of
    its packets'. Where the horizon is not given it is the recording's.
    """

    fitting_q: ClassVar[float] = 0.2
    recording: str = described("", "a recorded track with its packets, as straight_01_all_sensors.mbd")

    def __post_init__(self) -> None:
        object.__setattr__(self, "recording", str(self.recording))
        if not self.recording:
            raise ScenarioError("Replay.recording = '': must name a file such as straight_01_all_sensors.mbd")
        super().__post_init__()

    def check_measurement(self, measurement: Measurement) -> None:
        """Packets are for receivers of a beacon."""
        if not measurement.lasting_errors:
            raise ScenarioError(
                f"Scenario.measurement = {type(measurement).__name__}: must be Beacon with the motion 'replay'"
            )

    def horizon(self, period_s: float) -> int | None:
        """The recording's."""
        return periods_of(self.recording, period_s)

    def _track(self, scenario) -> np.ndarray:
        """The track (periods + 1, 4) of a recording; it begins where the first period's packets were sent.

        Raises:
            ScenarioError: the recording is shorter than the horizon, leaves the room, or has other receivers.
        """
        path, room = self.recording, scenario.field.room_m
        _, _, positions = recorded(path, scenario.period_s)
        if len(positions) < scenario.periods:
            most = f"at most {len(positions)}, those of {path}"
            raise ScenarioError(f"Scenario.periods = {scenario.periods}: must be {most}")
        theirs, ours = receivers_of(path)[:, :2], np.array(scenario.field.positions or ()).reshape(-1, 2)
        if theirs.shape != ours.shape or np.abs(theirs - ours).max() > SAME_PLACE_M:
            raise ScenarioError(
                f"Field.positions: must be those of the {len(theirs)} receivers of {path}, in the same order"
                " (calibrate on its folder)"
            )
        if not in_room(positions[:, 0], positions[:, 1], room).all():
            farthest = f"by more than {OUTSIDE_M:g} m"
            raise ScenarioError(f"{path}: leaves the room of {room[0]:g} x {room[1]:g} m (side_m, depth_m) {farthest}")
        track = np.empty((scenario.periods + 1, 4))
        track[1:, ::2] = positions[: scenario.periods]
        track[0] = track[1]
        for axis in (0, 2):
            track[:, axis + 1] = np.gradient(track[:, axis], scenario.period_s) if scenario.periods > 0 else 0.0
        return track

    def recorded_packets(self, scenario: Scenario) -> np.ndarray:
        """Mean level [dBm] and number of the packets that each receiver recorded: none in period 0."""
        levels, counts, _ = recorded(self.recording, scenario.period_s)
        packets = np.zeros((scenario.periods + 1, levels.shape[1], 2), np.float32)
        packets[1:, :, 0], packets[1:, :, 1] = levels[: scenario.periods], counts[: scenario.periods]
        return packets

    def recorded_tracks(self, scenario: Scenario) -> np.ndarray:
        """The one."""
        return self._track(scenario)[None]
