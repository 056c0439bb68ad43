"""Every shipped kind by name; files in these packages are found by themselves."""

from wsn_env.models.association.base import Association
from wsn_env.models.detection.base import DetectionRule
from wsn_env.models.fault.base import Fault
from wsn_env.models.kinds import Registry
from wsn_env.models.measurement.base import Measurement
from wsn_env.models.motion.base import Motion
from wsn_env.models.radio.base import Link

MEASUREMENTS = Registry(Measurement, "wsn_env.models.measurement")
DETECTIONS = Registry(DetectionRule, "wsn_env.models.detection")
MOTIONS = Registry(Motion, "wsn_env.models.motion")
RADIOS = Registry(Link, "wsn_env.models.radio")
ASSOCIATIONS = Registry(Association, "wsn_env.models.association")
FAULTS = Registry(Fault, "wsn_env.models.fault")
