"""The Gymnasium environments: actions, observations, rewards, pictures."""
