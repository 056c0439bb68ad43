"""The network of PreDC-v0 with nodes that report signal strengths."""

from wsn_env.models.measurement.rssi import Rssi
from wsn_env.scenario.scenario import Scenario

SCENARIO = Scenario(name="Rssi-v0", reference_error_m=4.0, measurement=Rssi())
