"""Recorded Bluetooth levels: tracks of the public dataset, what they say of the radio, and their replay."""
