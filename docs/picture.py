"""Animation at the top of the README and of the site's first page: one exposure, refocused.

Run: python docs/picture.py (about a minute and a half of CPU time)
"""

from pathlib import Path

import numpy as np
from PIL import Image

import lumigraph as lg

SIZE, VIEWS = (360, 640), 13
NEAREST, FARTHEST = 0.085, -0.085
"""Parallax of the leaves and of the wall over the aperture, in heights of the picture."""
FRAMES, COLOURS, PAUSE, STEP = 11, 256, 700, 110  # milliseconds at the ends, and between them
GAMMA = 1.4


def planes() -> np.ndarray:
    """Pictures (n, y, x, 3), 0 to 255, focused from the leaves to the wall."""
    views = lg.samples.scene(SIZE, VIEWS).views
    disparities = np.linspace(NEAREST, FARTHEST, FRAMES) * SIZE[0] / (VIEWS - 1)
    alphas = 1 - disparities * views.lenslets.pitch[1] / views.aperture.pitch[1]
    order = np.argsort(alphas)
    shown = np.asarray(lg.refocus_stack(views, alphas[order]))[np.argsort(order)]
    return np.round(255 * np.clip(shown, 0, 1) ** (1 / GAMMA)).astype(np.uint8)


def write(shown: np.ndarray, path: Path) -> None:
    """Film there and back, in one palette so that nothing flickers."""
    sheet = Image.fromarray(np.concatenate(shown[:: FRAMES // 2]))
    palette = sheet.quantize(COLOURS, method=Image.Quantize.FASTOCTREE)
    film = [Image.fromarray(frame).quantize(palette=palette) for frame in shown]
    film += film[-2:0:-1]
    pauses = [PAUSE if k % (FRAMES - 1) == 0 else STEP for k in range(len(film))]
    film[0].save(path, save_all=True, append_images=film[1:], duration=pauses, loop=0, optimize=True)


def main() -> None:
    """Pull the focus from the leaves to the wall and back."""
    write(planes(), Path(__file__).parent / "_static" / "refocus.gif")


if __name__ == "__main__":
    main()
