"""The network of PreDC-v0 that has to last: batteries of 2 mJ, 2,000 periods, a target that never leaves.

The target goes from one random point of the field to the next. A battery of 2 mJ pays for 60 reports over 10 m, or for
hearing 39; energy has no other price (lam = 0). An error counts as two
sensing radii at most, so that a network that is dead costs what a lost target costs, until the horizon.
`battery_j=(0.0005, 0.004)` draws the batteries for each episode.

What matters: when to be precise, and whose energy to spend; a schedule that is best for a period kills the network.
"""

from wsn_env.models.motion.waypoint import Waypoint
from wsn_env.models.radio.radio import Radio
from wsn_env.scenario.scenario import Scenario
from wsn_env.scenario.tracking import Tracking

SCENARIO = Scenario(
    name="Lifetime-v0",
    periods=2000,
    lam=0.0,
    error_cap_m=20.0,
    scarce_energy=True,
    typical_error_m=1.5,
    typical_energy_mj=0.1,
    reference_error_m=20.0,
    motion=Waypoint(),
    radio=Radio(battery_j=0.002),
    tracking=Tracking(particles=500),
)
