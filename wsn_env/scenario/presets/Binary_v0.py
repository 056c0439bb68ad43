"""Binary sensors and a sink (Zhou, Cheng & Xing, 2009).

600 nodes in 500 m x 500 m know one bit each: whether the target is within 60 m. An awake node reports to a sink in the
middle of the field when its bit has changed since it last sensed; silence tells, too. Episodes last 50 periods.

What matters: the nodes that tell most stand on the edge of the disc about the target, not near it.
"""

from wsn_env.models.detection.radius import Detection
from wsn_env.models.field import Field
from wsn_env.models.measurement.binary import Binary
from wsn_env.models.motion.crossing import Crossing
from wsn_env.models.radio.radio import Radio
from wsn_env.scenario.scenario import Scenario
from wsn_env.scenario.tracking import Tracking

SCENARIO = Scenario(
    name="Binary-v0",
    periods=50,
    lam=2.0,
    typical_error_m=1.5,
    reference_error_m=30.0,
    reference_energy_mj=1.0,
    field=Field(nodes=600, side_m=500.0),
    motion=Crossing(margin_m=60.0, crossing_m=250.0, acceleration_ms2=0.1),
    detection=Detection(radius_m=60.0, softness=1e-6, ceiling=1.0),
    measurement=Binary(),
    radio=Radio(receiver="sink", report_bits=64, invitation_bits=0),
    tracking=Tracking(manoeuvre_q=1.2, start_sd_m=10.0, start_sd_ms=1.0, rest_sd_ms=10.0),
)
