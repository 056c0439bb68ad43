"""System A's environment as others would write it: PreDC-v0 without the search for lost targets (so that it does less).

The action is the number of members beside the head, who is the living node nearest to the predicted position.
"""

FURTHER = 8  # members beside the head, at most
