"""Okabe and Ito's colours, which colour-blind readers tell apart: of every figure, frame and page.

M. Okabe, K. Ito: Color Universal Design, 2008.
"""

BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
YELLOW, BLUE, VERMILION, PURPLE = "#F0E442", "#0072B2", "#D55E00", "#CC79A7"
DARK, GREY, FAINT = "#333333", "#999999", "#CCCCCC"  # of what is beside the point
LINES = (VERMILION, BLUE, GREEN, PURPLE, ORANGE, SKY, BLACK)  # in this order


def rgb(colour: str) -> tuple[int, int, int]:
    """(213, 94, 0) of "#D55E00"."""
    red, green, blue = bytes.fromhex(colour[1:])
    return red, green, blue
