"""Prediction-based dynamic clustering (Xiang & Guo, 2013, Table 1): nodes report positions.

225 nodes are drawn anew in every episode, uniformly in 100 m x 100 m. The target crosses from one point of the inner
field to another, 40 m away or more. An awake node detects it with probability 0.6 up to 8 m, falling to 0 at 12 m, and
reports a position with 2 m of noise to the head, whose particle filter (5,000 particles) corrects with all reports.

What matters: any two reports tell about the same, so that the question is how many nodes, and when to move the head.

Every quantity is at its default.
"""

from wsn_env.scenario.scenario import Scenario

SCENARIO = Scenario(name="PreDC-v0")
