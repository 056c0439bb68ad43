"""The sections of a scenario: field, motion, sensing, radio, tracking. Frozen quantities with units.

Every default is system A's (Xiang & Guo, 2013, Table 1) unless its meaning says otherwise. Quantities that
follow from others are properties, never fields.
"""

from wsn_env.models.sections.beacon import Beacon
from wsn_env.models.sections.field import Field
from wsn_env.models.sections.motion import (
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
from wsn_env.models.sections.radio import RADIOS, RECEIVERS, Bluetooth, Link, Modem, Radio
from wsn_env.models.sections.sensing import (
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

__all__ = [
    "DETECTIONS",
    "MOTIONS",
    "RADIOS",
    "RECEIVERS",
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
    "Turns",
    "Walk",
    "Waypoint",
]
