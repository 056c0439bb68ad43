"""Bluetooth receivers in a hall: the twelve of Danis, Naskali, Cemgil & Ersoy (2022), calibrated on six tracks.

12 receivers in a hall of 20.7 m x 17.6 m hear a beacon that is walked about. A receiver that is awake scans for the
period (16.2 mJ) and passes every packet on to a sink. Simulated levels have a static field, a drift, skewed noise,
rounding and bursts of losses, as they were measured; with `motion="replay", recording=FILE` the packets are those of a
published recording.

What matters: energy counts listeners. The nearest and the strongest receivers are the wrong ones; those that tell most
are predicted by the tracker.
"""

from wsn_env.models.detection.radius import Detection
from wsn_env.models.field import Field
from wsn_env.models.measurement.beacon import Beacon
from wsn_env.models.motion.walk import Walk
from wsn_env.models.radio.bluetooth import Bluetooth
from wsn_env.scenario.scenario import Scenario
from wsn_env.scenario.tracking import Tracking

DONGLES = (  # m, in the order of the dataset's file
    (7.00, 7.09),
    (7.18, 0.68),
    (0.71, 6.16),
    (7.25, 11.36),
    (0.76, 12.13),
    (7.18, 17.64),
    (13.14, 12.33),
    (12.82, 16.83),
    (18.12, 11.93),
    (13.01, 5.51),
    (17.77, 6.33),
    (12.76, 0.27),
)

SCENARIO = Scenario(
    name="Ble-v0",
    lam=0.006,
    typical_error_m=1.8,
    typical_energy_mj=194.0,
    reference_error_m=5.0,
    reference_energy_mj=220.0,
    unscored=3,
    field=Field(side_m=20.66, depth_m=17.641, positions=DONGLES),
    motion=Walk(),
    detection=Detection(),
    measurement=Beacon(
        at_1m_db=(-60.1, -57.2, -58.8, -60.4, -61.8, -55.2, -64.3, -56.8, -61.3, -60.0, -56.7, -57.3),
        exponents=(1.57, 1.80, 1.56, 1.70, 1.58, 1.95, 1.93, 1.74, 1.34, 2.19, 1.29, 1.79),
        heights_m=(1.22, 2.30, 2.30) * 4,
        beacon_m=1.8,
    ),
    radio=Bluetooth(),
    tracking=Tracking(
        particles=1000,
        start="field",
        rest_sd_ms=0.4,
        velocity_s=10.0,
        resample_below=0.6,
        search=False,
    ),
)
