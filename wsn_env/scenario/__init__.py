"""What is simulated: a scenario of quantities with units, and the published systems as presets."""

from wsn_env.scenario.scenario import Scenario, named_scenarios

__all__ = ["Scenario", "named_scenarios"]
