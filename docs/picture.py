"""The moving picture of the README and of the site's first page.

Run: python docs/picture.py
"""

from pathlib import Path

import numpy as np

import lumigraph as lg


def main() -> None:
    """Pull the focus from the leaves to the wall and back."""
    views = lg.samples.scene((144, 192)).views
    ends = np.concatenate(
        [np.linspace(1.9, -1.5, 14), np.linspace(-1.5, 1.9, 14)[1:-1]]
    )  # disparities in focus
    step = views.lenslets.pitch[1] / views.aperture.pitch[1]
    frames = lg.refocus_stack(views, 1 - np.sort(ends)[::-1] * step)
    order = np.argsort(np.argsort(-ends, kind="stable"), kind="stable")
    shown = np.round(255 * np.clip(np.asarray(frames), 0, 1) ** (1 / 2.2)).astype(np.uint8)
    lg.save([shown[k] for k in order], Path(__file__).parent / "_static" / "refocus.gif", fps=10)


if __name__ == "__main__":
    main()
