"""Smooth shapes on an image, many in a call.

A shape covers a pixel by how far the pixel's middle is inside its edge, so that edges are smooth. Coordinates are
pixels, x to the right and y downward. `clip` is left, top, right, bottom; nothing is drawn beyond. Shapes of one call
that must not darken each other where they overlap are first gathered in `most` (H, W) float32, which is all 0 before
and after.
"""

from typing import Any

import numpy as np

from wsn_env.compiled.kernels import lean_kernel, lean_piece

FAR = 1e6  # px; shapes beyond are left out


@lean_piece
def _mix(image, x, y, share, colour):
    for c in range(3):
        under = np.float64(image[y, x, c])
        image[y, x, c] = np.uint8(under + share * (colour[c] - under) + 0.5)


@lean_kernel
def draw_discs(
    image: np.ndarray, clip: Any, centres: np.ndarray, radius: Any, hole: Any, square: Any, colours: np.ndarray
) -> None:
    """Discs, rings or squares of one size.

    Args:
        centres: (N, 2).
        radius: of all; half the side of a square.
        hole: radius of what is left out; below 0: nothing.
        colours: (N, 3); or (1, 3), of all.
    """
    for k in range(len(centres)):
        cx, cy = centres[k, 0], centres[k, 1]
        if not (abs(cx) < FAR and abs(cy) < FAR):
            continue
        colour = colours[min(k, len(colours) - 1)]
        for y in range(max(int(cy - radius) - 1, clip[1]), min(int(cy + radius) + 3, clip[3])):
            for x in range(max(int(cx - radius) - 1, clip[0]), min(int(cx + radius) + 3, clip[2])):
                dx, dy = x - cx, y - cy
                distance = max(abs(dx), abs(dy)) if square else np.sqrt(dx * dx + dy * dy)
                share = min(radius + 0.5 - distance, distance - hole + 0.5, 1.0)
                if share > 0.0:
                    _mix(image, x, y, share, colour)


@lean_kernel
def draw_lines(image: np.ndarray, most: Any, clip: Any, lines: Any, colour: Any) -> None:
    """Lines with round ends.

    Args:
        lines: their starts and ends, (N, 2) each, their widths and opacities, (N,) each.
        colour: (3,).
    """
    starts, ends, widths, opacities = lines
    for drawing in range(2):  # first gather, then draw
        for k in range(len(starts)):
            x0, y0, x1, y1 = starts[k, 0], starts[k, 1], ends[k, 0], ends[k, 1]
            if not (abs(x0) < FAR and abs(y0) < FAR and abs(x1) < FAR and abs(y1) < FAR):
                continue
            steep = abs(y1 - y0) > abs(x1 - x0)
            u0, u1, v0, v1 = (y0, y1, x0, x1) if steep else (x0, x1, y0, y1)
            low_u, high_u = (clip[1], clip[3]) if steep else (clip[0], clip[2])
            low_v, high_v = (clip[0], clip[2]) if steep else (clip[1], clip[3])
            du, dv, half = u1 - u0, v1 - v0, 0.5 * widths[k]
            squared = max(du * du + dv * dv, 1e-9)
            slope = dv / du if du != 0.0 else 0.0
            reach = half * 1.4143 + 1.0
            for u in range(max(int(min(u0, u1) - half) - 1, low_u), min(int(max(u0, u1) + half) + 2, high_u)):
                middle = v0 + slope * (u - u0)
                for v in range(max(int(middle - reach), low_v), min(int(middle + reach) + 2, high_v)):
                    x, y = (v, u) if steep else (u, v)
                    if drawing:
                        if most[y, x] > 0.0:
                            _mix(image, x, y, most[y, x], colour)
                            most[y, x] = 0.0
                        continue
                    part = min(max(((u - u0) * du + (v - v0) * dv) / squared, 0.0), 1.0)
                    far_u, far_v = u - u0 - part * du, v - v0 - part * dv
                    share = min(half + 0.5 - np.sqrt(far_u * far_u + far_v * far_v), 1.0) * opacities[k]
                    if share > most[y, x]:
                        most[y, x] = share


@lean_kernel
def draw_cloud(image: np.ndarray, most: Any, clip: Any, x: Any, y: Any, weights: np.ndarray, colour: Any) -> None:
    """Points of about a pixel; where n of them are the colour's share is n / (1 + n).

    Args:
        x, y: (P,).
        weights: (P,), how many points each is.
    """
    for drawing in range(2):
        for k in range(len(x)):
            if not (clip[0] <= x[k] < clip[2] - 1 and clip[1] <= y[k] < clip[3] - 1):
                continue
            left, top = int(x[k]), int(y[k])
            right, low = x[k] - left, y[k] - top
            for j in range(2):
                for i in range(2):
                    if drawing:
                        count = most[top + j, left + i]
                        if count > 0.0:
                            _mix(image, left + i, top + j, count / (1.0 + count), colour)
                            most[top + j, left + i] = 0.0
                    else:
                        share = (right if i else 1.0 - right) * (low if j else 1.0 - low)
                        most[top + j, left + i] += share * weights[k]


@lean_kernel
def draw_shade(image: np.ndarray, steps: Any, clip: Any, centres: np.ndarray, radius: Any, tints: np.ndarray) -> None:
    """Areas within a radius of any centre, in the n-th tint where n overlap. What was drawn there is lost.

    Args:
        steps: (W + 1,) float32, all 0 before and after.
        centres: (N, 2).
        tints: (K, 3); the last for K and more.
    """
    for y in range(clip[1], clip[3]):
        for k in range(len(centres)):
            dy = y - centres[k, 1]
            if abs(dy) < radius:
                half = np.sqrt(radius * radius - dy * dy)
                steps[min(max(int(np.ceil(centres[k, 0] - half)), clip[0]), clip[2])] += 1.0
                steps[min(max(int(np.ceil(centres[k, 0] + half)), clip[0]), clip[2])] -= 1.0
        depth = 0
        for x in range(clip[0], clip[2]):
            depth += int(steps[x])
            steps[x] = 0.0
            if depth > 0:
                for c in range(3):
                    image[y, x, c] = tints[min(depth, len(tints)) - 1, c]
        steps[clip[2]] = 0.0
