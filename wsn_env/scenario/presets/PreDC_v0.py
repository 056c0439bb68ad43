"""Prediction-based dynamic clustering (Xiang & Guo, 2013): nodes report positions. Every quantity is at its default."""

from wsn_env.scenario.scenario import Scenario

SCENARIO = Scenario(name="PreDC-v0")
