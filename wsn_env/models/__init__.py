"""What the world is made of: measurements, detection, motion, radio, faults; a kind is one class in one file.

What a kind of your own needs is handed on here: the base of its role, `quantity` for its settings, `Line`.
"""

from wsn_env.models.detection.base import DetectionRule
from wsn_env.models.fault.base import Fault
from wsn_env.models.measurement.base import Line, Measurement, Node
from wsn_env.models.motion.base import Course, Motion
from wsn_env.models.quantity import ScenarioError, quantity
from wsn_env.models.radio.base import Link

__all__ = [
    "Course",
    "DetectionRule",
    "Fault",
    "Line",
    "Link",
    "Measurement",
    "Motion",
    "Node",
    "ScenarioError",
    "quantity",
]
