"""What training a scheduler takes: networks, adapters to the libraries, rewards, tuning."""
