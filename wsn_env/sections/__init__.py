"""The sections of a scenario: field, motion, sensing, radio, tracking. Frozen quantities with units.

Every default is system A's (Xiang & Guo, 2013, Table 1) unless its meaning says otherwise. Quantities that
follow from others are properties, never fields.
"""

from wsn_env.sections.beacon import Beacon
from wsn_env.sections.field import Field
from wsn_env.sections.motion import (
    MOTIONS,
    Circle,
    Crossing,
    Cruise,
    Legs,
    Motion,
    Recorded,
    Replay,
    Sine,
    Straight,
    Turns,
    Walk,
    Waypoint,
)
from wsn_env.sections.radio import RADIOS, RECEIVERS, Bluetooth, Link, Modem, Radio
from wsn_env.sections.sensing import (
    DETECTIONS,
    Binary,
    Detection,
    Level,
    Measurement,
    Position,
    Rssi,
    RssiPower,
    Sonar,
    Threshold,
)
from wsn_env.sections.tracking import BOUNDARY_TRACKERS, MEASUREMENTS, READS, TRACKERS, Tracking

__all__ = [
    "BOUNDARY_TRACKERS",
    "DETECTIONS",
    "MEASUREMENTS",
    "MOTIONS",
    "RADIOS",
    "READS",
    "RECEIVERS",
    "TRACKERS",
    "Beacon",
    "Binary",
    "Bluetooth",
    "Circle",
    "Crossing",
    "Cruise",
    "Detection",
    "Field",
    "Legs",
    "Level",
    "Link",
    "Measurement",
    "Modem",
    "Motion",
    "Position",
    "Radio",
    "Recorded",
    "Replay",
    "Rssi",
    "RssiPower",
    "Sine",
    "Sonar",
    "Straight",
    "Threshold",
    "Tracking",
    "Turns",
    "Walk",
    "Waypoint",
]
