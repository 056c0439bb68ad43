"""Labels of points in a picture that neither cover each other, nor other points, nor leave the axes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from wsn_env.reports.pictures import escape_label

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NEAR, FAR = 7, 18  # points between a label and what it names
POINT = 5  # half of a marker's width, in points


class Label(NamedTuple):
    """What is written at a point."""

    text: str
    point: tuple[float, float]  # in data
    colour: str
    size: float = 9.0


class Box(NamedTuple):
    """In pixels."""

    left: float
    low: float
    right: float
    high: float

    def meets(self, other: Box) -> bool:
        """Whether they overlap."""
        apart = self.right <= other.left or other.right <= self.left or self.high <= other.low or other.high <= self.low
        return not apart

    def within(self, other: Box) -> bool:
        """Whether it lies in the other."""
        return (
            self.left >= other.left and self.right <= other.right and self.low >= other.low and self.high <= other.high
        )


def write_labels(axes: Axes, labels: Sequence[Label]) -> list[Label]:
    """Write each where there is room about its point: above right first, then around it, then farther off.

    For axes whose limits and layout are settled.

    Returns: those for which there is no room.
    """
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import TextPath

    figure: Any = axes.figure
    figure.draw_without_rendering()
    scale = figure.dpi / 72.0
    frame = Box(*axes.get_window_extent().extents)
    points = [axes.transData.transform(label.point) for label in labels]
    taken = [Box(x - POINT * scale, y - POINT * scale, x + POINT * scale, y + POINT * scale) for x, y in points]
    legend = axes.get_legend()
    if legend is not None:
        taken.append(Box(*legend.get_window_extent().extents))
    left_out = []
    for i, (label, (x, y)) in enumerate(zip(labels, points)):
        bounds = TextPath((0, 0), escape_label(label.text or " "), prop=FontProperties(size=label.size)).get_extents()
        width, height = scale * max(bounds.width, 1.0), scale * label.size
        for gap in (NEAR * scale, FAR * scale):
            places = [
                *((x + gap, y + gap / 2), (x - gap - width, y + gap / 2)),
                *((x + gap, y - gap / 2 - height), (x - gap - width, y - gap / 2 - height)),
                *((x - width / 2, y + gap), (x - width / 2, y - gap - height)),
            ]
            boxes = [Box(left, low, left + width, low + height) for left, low in places]
            free = [
                box
                for box in boxes
                if box.within(frame) and not any(box.meets(each) for k, each in enumerate(taken) if k != i)
            ]
            if free:
                break
        else:
            left_out.append(label)
            continue
        taken.append(free[0])
        axes.annotate(
            escape_label(label.text),
            label.point,
            xytext=((free[0].left - x) / scale, (free[0].low - y) / scale),
            textcoords="offset points",
            fontsize=label.size,
            color=label.colour,
            annotation_clip=True,
        )
    return left_out
