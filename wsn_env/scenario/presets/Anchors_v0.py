"""Eight anchors that a target hears (the network of FOA-GRNN with an iterated cubature filter).

The target carries a receiver and listens to some of 8 anchors on a ring of 200 m x 200 m; every beacon that it hears
costs its sender 128 bits (eq. 5). Levels fall with exponent 3, noise 3 dB. Episodes last 50 periods.

What matters: which anchors. Two that stand well cost an eleventh of all eight, for an error a third larger.
"""

from wsn_env.models.detection.radius import Detection
from wsn_env.models.field import Field
from wsn_env.models.measurement.rssi import Rssi
from wsn_env.models.motion.crossing import Crossing
from wsn_env.models.radio.radio import Radio
from wsn_env.scenario.scenario import Scenario
from wsn_env.scenario.tracking import Tracking

RING_OF_EIGHT = tuple((x, y) for y in (0.0, 100.0, 200.0) for x in (0.0, 100.0, 200.0) if (x, y) != (100.0, 100.0))

SCENARIO = Scenario(
    name="Anchors-v0",
    lam=10.0,
    typical_error_m=11.0,
    reference_error_m=40.0,
    reference_energy_mj=3.0,
    periods=50,
    field=Field(side_m=200.0, positions=RING_OF_EIGHT),
    motion=Crossing(margin_m=20.0, crossing_m=80.0, acceleration_ms2=0.5),
    detection=Detection(radius_m=360.0, ceiling=1.0),
    measurement=Rssi(exponent=3.0),
    radio=Radio(receiver="target", report_bits=128, invitation_bits=0, retries=0),
    tracking=Tracking(manoeuvre_q=3.0, start_sd_m=10.0, start_sd_ms=1.0, search=False),
)
