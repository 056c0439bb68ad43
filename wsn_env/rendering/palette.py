"""Colours of frames."""

# Okabe and Ito's palette: told apart by colour-blind eyes too.
INK = (0, 0, 0)
ORANGE, SKY, GREEN, YELLOW = (230, 159, 0), (86, 180, 233), (0, 158, 115), (240, 228, 66)
BLUE, VERMILLION, PURPLE = (0, 114, 178), (213, 94, 0), (204, 121, 167)
PAPER, FLASH, FRAME, DIM = (255, 255, 255), (255, 250, 205), (170, 170, 170), (105, 105, 105)
CROSS = (140, 140, 140)
FULL, EMPTY = (125, 133, 140), (232, 234, 236)  # a node's inside, by its battery
SENSED = ((243, 243, 239), (233, 233, 228), (223, 223, 217), (213, 213, 206))  # by how many awake nodes sense there
