"""Colours of frames."""

from wsn_env.envs.rendering import colours
from wsn_env.envs.rendering.colours import rgb

INK, ORANGE, SKY, GREEN = map(rgb, (colours.BLACK, colours.ORANGE, colours.SKY, colours.GREEN))
YELLOW, BLUE, VERMILION, PURPLE = map(rgb, (colours.YELLOW, colours.BLUE, colours.VERMILION, colours.PURPLE))
PAPER, FLASH, FRAME, DIM = (255, 255, 255), (255, 250, 205), (170, 170, 170), (105, 105, 105)
CROSS = (140, 140, 140)
FULL, EMPTY = (125, 133, 140), (232, 234, 236)  # a node's inside, by its battery
SENSED = ((243, 243, 239), (233, 233, 228), (223, 223, 217), (213, 213, 206))  # by how many awake nodes sense there
