"""The network of PreDC-v0 with nodes that report signal strengths (eq. 1 of Xiang & Guo, 2013).

A node measures a strength in dB, -40 - 25 log10(d) with noise of 3 dB: a distance, not a direction, so that it matters
where the awake nodes stand around the target.

What matters: geometry. Three nodes on three sides beat six on one; the menu's order `"information"` knows it.
"""

from wsn_env.models.measurement.rssi import Rssi
from wsn_env.scenario.scenario import Scenario

SCENARIO = Scenario(name="Rssi-v0", reference_error_m=4.0, measurement=Rssi())
