"""The image of a slit by a single lens, plane by plane.

Run: python examples/only_waves.py
"""

import numpy as np

import lumigraph as lg
from lumigraph.units import mm, nm, um


def main() -> None:
    grid = lg.Grid.square(2000, 5 * um)
    slit = np.zeros(grid.shape, np.complex64)
    slit[900:1100, 990:1010] = 1
    field = lg.Field(slit, grid, 633 * nm)

    choice = lg.choose_method(grid, 316 * mm, 633 * nm)
    print(f"{choice.method}, because {choice.reason}")

    leg = lg.Propagate(316 * mm, grid=grid)  # light beyond the window misses the lens
    train = lg.Train((leg, lg.ThinLens(158 * mm, 5 * mm), leg))
    names = ("slit", "before the lens", "behind it", "image")
    lg.plots.planes(train.planes(field), names=names).savefig("planes.png")


if __name__ == "__main__":
    main()
