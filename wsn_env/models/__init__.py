"""What the world is made of: measurements, detection, motion, radio."""
