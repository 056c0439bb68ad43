"""What is simulated: a scenario of quantities with units, and the published systems as presets."""

from wsn_env.scenario.scenario import Scenario, presets

__all__ = ["Scenario", "presets"]
