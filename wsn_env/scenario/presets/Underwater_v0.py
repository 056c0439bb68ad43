"""Underwater tracking by the strongest signal (patent CN103152791).

64 nodes stand in a jittered grid of 1 km x 1 km; periods last 5 s. A node detects when the level that it hears exceeds
85 dB, and reports that level over an acoustic modem with a range of 250 m. Sleeping costs energy, too. The filter
(1,000 particles) also weighs who kept silent.

What matters: a report costs a thousand times what it does on land, so lam is a thousand times smaller; members must be
within one hop of the head.
"""

from wsn_env.models.detection.threshold import Threshold
from wsn_env.models.field import Field
from wsn_env.models.measurement.sonar import Sonar
from wsn_env.models.motion.cruise import Cruise
from wsn_env.models.radio.modem import Modem
from wsn_env.scenario.scenario import Scenario
from wsn_env.scenario.tracking import Tracking

SCENARIO = Scenario(
    name="Underwater-v0",
    period_s=5.0,
    lam=0.006,
    typical_error_m=16.0,
    typical_energy_mj=1400.0,
    reference_error_m=120.0,
    reference_energy_mj=2200.0,
    field=Field(nodes=64, side_m=1000.0, layout="grid"),
    motion=Cruise(),
    detection=Threshold(),
    measurement=Sonar(),
    radio=Modem(),
    tracking=Tracking(
        particles=1000,
        silent_information=True,
        manoeuvre_q=0.03,
        resampling="spread",
        start_sd_m=20.0,
        start_sd_ms=1.0,
    ),
)
