"""A toy robot on a chequered table, a garland of lights behind it, leaves before it.

Painted, not photographed. Places are (y, x) in heights of the picture, (0, 0) in its middle, y downwards.
Every layer is a function of them, so that each view samples the scene itself: no picture is interpolated.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

Colour = tuple[float, float, float]

INK, SHADE, WHITE = (0.05, 0.05, 0.08), (0.30, 0.33, 0.38), (1.0, 1.0, 1.0)
RED, TEAL, AMBER, CREAM = (0.78, 0.16, 0.12), (0.10, 0.45, 0.46), (0.95, 0.62, 0.12), (0.93, 0.88, 0.76)
BROWN, GREEN = (0.34, 0.16, 0.10), (0.16, 0.38, 0.10)
LIGHTS = ((1.0, 0.85, 0.45), (1.0, 0.55, 0.35), (0.65, 0.85, 1.0))

BLADES = (
    (-0.60, 0.25, -0.28, 0.030),
    (-0.50, -0.18, -0.05, 0.026),
    (-0.44, 0.16, 0.10, 0.022),
    (-0.66, 0.05, -0.12, 0.028),
    (0.62, -0.22, -0.22, 0.030),
    (0.52, 0.20, 0.00, 0.026),
    (0.46, -0.10, 0.16, 0.020),
    (0.68, 0.02, -0.35, 0.026),
)
"""Shape of each leaf: x of the root, how far the tip leans over, y of the tip, half width."""


@dataclass(frozen=True, slots=True)
class Canvas:
    """Picture of one layer, and its place.

    Parameters
    ----------
    colour
        (n, m, 3), 0 to 1.
    cover
        (n, m), true where the layer hides what is behind it.
    y, x
        Places of the rows, (n, 1), and of the columns, (m,) or (n, m).
    """

    colour: np.ndarray
    cover: np.ndarray
    y: np.ndarray
    x: np.ndarray

    def within(self, top: float, bottom: float, left: float, right: float) -> "Canvas":
        """The part between two rows and two columns, of a canvas whose columns are straight."""
        rows = slice(*np.searchsorted(self.y[:, 0], (top, bottom)))
        columns = slice(*np.searchsorted(self.x, (left, right)))
        return Canvas(self.colour[rows, columns], self.cover[rows, columns], self.y[rows], self.x[columns])

    def fill(self, where: Any, colour: Colour | np.ndarray) -> None:
        """Paint places."""
        self.colour[where] = colour
        self.cover[where] = True

    def disc(self, middle: tuple[float, float], radius: float, colour: Colour) -> "Canvas":
        """Paint a disc; returns the square that holds it."""
        (y, x), r = middle, radius
        part = self.within(y - r, y + r, x - r, x + r)
        part.fill((part.y - y) ** 2 + (part.x - x) ** 2 < r**2, colour)
        return part

    def box(
        self, middle: tuple[float, float], half: tuple[float, float], corner: float, colour: Colour
    ) -> "Canvas":
        """Paint a box with round corners; returns the part that holds it."""
        part = self.within(middle[0] - half[0], middle[0] + half[0], middle[1] - half[1], middle[1] + half[1])
        down = np.maximum(np.abs(part.y - middle[0]) - half[0] + corner, 0)
        across = np.maximum(np.abs(part.x - middle[1]) - half[1] + corner, 0)
        part.fill(down**2 + across**2 < corner**2, colour)
        return part


@dataclass(frozen=True, slots=True)
class Layer:
    """Something opaque in a plane, which may slant towards the viewer at its lower end.

    Parameters
    ----------
    paint
        Paints it on a canvas, as seen from the middle view.
    parallax
        Displacement from the first view to the last [heights]; positive is nearer.
    slant
        Change of the parallax for each height downwards.
    """

    paint: Callable[[Canvas], None]
    parallax: float
    slant: float = 0.0

    def at(self, y: np.ndarray) -> np.ndarray:
        """Parallax [heights] of what the middle view shows at y."""
        return self.parallax + self.slant * y

    def seen(self, y: np.ndarray, x: np.ndarray, place: tuple[float, float]) -> Canvas:
        """The layer at rows y (n, 1) and columns x (m,) from a place (v, u) on the aperture, -1/2 to 1/2."""
        own = (y - self.parallax * place[0]) / (1 + self.slant * place[0])
        columns = x - (self.at(own) * place[1] if self.slant else self.parallax * place[1])
        shape = len(y), len(x)
        canvas = Canvas(np.zeros((*shape, 3), np.float32), np.zeros(shape, bool), own, columns)
        self.paint(canvas)
        return canvas


def _evening(canvas: Canvas) -> None:
    """A brick wall in the dusk with two garlands of lights."""
    row = np.floor(canvas.y / 0.055)
    along = canvas.x / 0.13 + 0.5 * (row % 2)
    brick = np.floor(along)
    mortar = (np.abs(canvas.y / 0.055 - row - 0.5) > 0.42) | (np.abs(along - brick - 0.5) > 0.46)
    tone = 0.12 + 0.05 * np.sin(12.9 * row + 78.2 * brick) + 0.10 * (0.5 - canvas.y)
    canvas.fill(..., tone[..., None] * np.array((1.25, 0.75, 0.8), np.float32))
    canvas.fill(mortar, (0.07, 0.06, 0.08))
    for k in range(13):
        x = -0.95 + 0.158 * k
        for y in (-0.40 + 0.10 * np.cos(2.4 * x), -0.20 + 0.08 * np.cos(3.1 * x + 1)):
            canvas.disc((y, x + 0.06 * y), 0.011, LIGHTS[k % 3])


def _table(canvas: Canvas) -> None:
    """Chequered; its squares shrink towards the far edge."""
    below = canvas.y - 0.17
    depth = 1 / np.maximum(below + 0.22, 1e-3)
    chequer = (np.floor(1.3 * depth) + np.floor(1.1 * canvas.x * depth)) % 2
    colour = np.where(chequer[..., None] > 0, np.array(CREAM, np.float32), np.array(BROWN, np.float32))
    canvas.colour[:] = colour * np.clip(0.45 + 0.9 * below, 0, 1)[..., None]
    canvas.cover[:] = below > 0


def _robot(canvas: Canvas) -> None:
    """The subject: fine lines, dials and bars, so that focus shows."""
    canvas = canvas.within(-0.36, 0.36, -0.24, 0.24)
    canvas.box((0.19, 0.0), (0.15, 0.17), 0.03, TEAL)
    for side in (-1, 1):
        canvas.box((0.18, 0.205 * side), (0.11, 0.028), 0.025, TEAL)
        canvas.box((-0.10, 0.17 * side), (0.05, 0.02), 0.01, SHADE)
    neck = canvas.box((0.02, 0.0), (0.04, 0.05), 0.01, SHADE)
    neck.fill(np.broadcast_to(np.floor(neck.y / 0.008) % 2 > 0, neck.cover.shape), INK)
    canvas.box((-0.11, 0.0), (0.12, 0.15), 0.05, RED)
    canvas.colour[:] *= np.clip(1.15 - 1.4 * np.abs(canvas.x + 0.06), 0.55, 1.2)[:, None]
    canvas.box((-0.27, 0.0), (0.05, 0.006), 0.005, SHADE)
    canvas.disc((-0.325, 0.0), 0.022, AMBER)
    _face(canvas)
    _panel(canvas)


def _face(canvas: Canvas) -> None:
    for side in (-1, 1):
        eye = (-0.14, 0.065 * side)
        canvas.disc(eye, 0.043, INK)
        canvas.disc(eye, 0.037, CREAM)
        iris = canvas.disc(eye, 0.027, AMBER)
        iris.fill(_ring(iris, eye, 0.027, 24), (0.55, 0.28, 0.05))
        canvas.disc(eye, 0.012, INK)
        canvas.disc((eye[0] - 0.012, eye[1] + 0.012), 0.006, WHITE)
    mouth = canvas.box((-0.035, 0.0), (0.022, 0.085), 0.01, INK)
    inside = np.abs(mouth.y + 0.035) < 0.017
    mouth.fill(inside & (np.floor(mouth.x / 0.0075) % 2 > 0), CREAM)


def _panel(canvas: Canvas) -> None:
    canvas.box((0.15, 0.0), (0.075, 0.125), 0.015, CREAM)
    for k, needle in enumerate((2.2, 0.9, -0.4)):
        middle = (0.125, -0.08 + 0.08 * k)
        canvas.disc(middle, 0.033, INK)
        dial = canvas.disc(middle, 0.029, WHITE)
        dial.fill(_ring(dial, middle, 0.029, 18), INK)
        canvas.disc(middle, 0.022, WHITE)
        y, x = dial.y - middle[0], dial.x - middle[1]
        across, along = x * np.sin(needle) - y * np.cos(needle), x * np.cos(needle) + y * np.sin(needle)
        dial.fill((np.abs(across) < 0.0025) & (along > 0) & (along < 0.025), RED)
    chart = canvas.within(0.18, 0.212, -0.11, 0.11)
    for k in range(6):  # bars of falling width, as on a chart
        left, width = -0.105 + 0.036 * k, 0.008 / 1.28**k
        bars = (np.floor((chart.x - left) / width) % 2 > 0) & (chart.x > left) & (chart.x < left + 0.03)
        chart.fill(np.broadcast_to(bars, chart.cover.shape), INK)
    for k in range(7):
        canvas.disc((0.275, -0.12 + 0.04 * k), 0.008, AMBER if k % 2 else INK)


def _ring(canvas: Canvas, middle: tuple[float, float], radius: float, rays: int) -> np.ndarray:
    """Every second of the rays of a disc."""
    y, x = canvas.y - middle[0], canvas.x - middle[1]
    return (y**2 + x**2 < radius**2) & (np.floor(np.arctan2(y, x) * rays / np.pi) % 2 > 0)


def _leaves(canvas: Canvas) -> None:
    """Blades that grow from below on both sides."""
    for root, lean, top, width in BLADES:
        left, right = min(root, root + lean) - width, max(root, root + lean) + width
        part = canvas.within(top, 0.6, left, right)
        rise = np.clip((0.55 - part.y) / (0.55 - top), 0, 1)
        off = part.x - root - lean * rise**2
        blade = np.abs(off) < width * np.sqrt(1 - rise)
        tone = (0.75 + 0.35 * (off > 0) + 0.25 * (np.abs(off) < 0.0025)) * (0.6 + 0.7 * rise)
        part.fill(blade, tone[blade][:, None] * np.array(GREEN, np.float32))


LAYERS = (
    Layer(_evening, -0.085),
    Layer(_table, -0.112, 0.365),
    Layer(_robot, 0.012),
    Layer(_leaves, 0.085),
)
"""Layers from the back to the front; each hides what is behind it. The robot stands on the table."""
