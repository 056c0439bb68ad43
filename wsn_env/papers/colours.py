"""Okabe and Ito's colours, which colour-blind readers tell apart; a system keeps its own in all figures of a paper."""

BLACK, VERMILION, BLUE, GREEN = "#000000", "#D55E00", "#0072B2", "#009E73"
SKY, PURPLE, YELLOW, GREY = "#56B4E9", "#CC79A7", "#F0E442", "#999999"
