"""The sections of a scenario: field, motion, sensing, radio, tracking. Frozen quantities with units.

Every default is system A's (Xiang & Guo, 2013, Table 1) unless its meaning says otherwise. Quantities that
follow from others are properties, never fields.
"""

from wsn_env.sections.field import Field
from wsn_env.sections.motion import (
    MOTIONS,
    Circle,
    Crossing,
    Cruise,
    Legs,
    Motion,
    Recorded,
    Sine,
    Straight,
    Turns,
    Waypoint,
)
from wsn_env.sections.radio import RADIOS, RECEIVERS, Link, Modem, Radio
from wsn_env.sections.sensing import (
    DETECTIONS,
    MEASUREMENTS,
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
from wsn_env.sections.tracking import BOUNDARY_TRACKERS, READS, TRACKERS, Tracking

__all__ = [
    "BOUNDARY_TRACKERS",
    "DETECTIONS",
    "MEASUREMENTS",
    "MOTIONS",
    "RADIOS",
    "READS",
    "RECEIVERS",
    "TRACKERS",
    "Binary",
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
    "Rssi",
    "RssiPower",
    "Sine",
    "Sonar",
    "Straight",
    "Threshold",
    "Tracking",
    "Turns",
    "Waypoint",
]
