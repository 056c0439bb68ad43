"""What training a scheduler takes: networks, adapters to the libraries and rewards."""
