"""`wsn train`: a PPO scheduler for every trade-off, beside every baseline."""
