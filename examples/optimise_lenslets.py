"""Find lenslets by gradients: the magnification and focal length that give two contrasts one wants.

A lenslet of a focused camera forms a small image of the main-lens image. How much contrast it leaves depends
on its distance a = f (1 + 1/m) (diffraction) and on its magnification m (pixels). Asked for a contrast at a
coarse and at a fine pattern, PyTorch follows the derivatives of the simulated image after f and m, through
the wave that leaves a point, the lenslet, and the way to the sensor.

    python examples/optimise_lenslets.py
"""

import math

import numpy as np

import lumigraph as lg
from lumigraph.units import mm, nm, um

WAVELENGTH, PITCH, PIXEL = 633 * nm, 150 * um, 6 * um
WANTED = {8e3: 0.55, 15e3: 0.17}
"""Contrast by frequency in the main-lens image [1/m]."""

LENSLET = lg.Grid.square(100, PITCH / 100)  # the opening is the window
SENSOR = lg.Grid.square(240, 4 * um)


def contrasts(torch, focal_length, magnification):
    """Contrast at each of the frequencies, of a point imaged by one lenslet onto pixels."""
    near, far = focal_length * (1 + 1 / magnification), focal_length * (1 + magnification)
    point = lg.Field(torch.ones((1, 1), dtype=torch.complex128), lg.Grid.square(1, 1 * um), WAVELENGTH)
    train = lg.Train((
        lg.Propagate(near, "fresnel", grid=LENSLET),
        lg.LensletArray(lg.Lattice.square(PITCH), focal_length),
        lg.Propagate(far, "fresnel", grid=SENSOR),
    ))  # fmt: skip
    line = train(point).intensity.sum(0)  # of a point: its line image
    x = torch.asarray(SENSOR.x)
    found = []
    for frequency in WANTED:
        there = frequency / magnification  # the lenslet makes patterns smaller
        wave = torch.exp(2j * math.pi * x * there)
        pixels = torch.sinc(there * PIXEL)
        found.append(torch.abs((line * wave).sum() / line.sum()) * pixels)
    return torch.stack(found)


def by_hand(focal_length, magnification):
    """The same from closed forms: a square lenslet's triangle, a pixel's sinc."""
    near = focal_length * (1 + 1 / magnification)
    return [(1 - f * WAVELENGTH * near / PITCH) * np.sinc(f * PIXEL / magnification) for f in WANTED]


def main():
    try:
        import torch
    except ImportError:
        print("This example differentiates with PyTorch, which is not installed (make torch).")
        return
    wanted = torch.tensor(list(WANTED.values()), dtype=torch.float64)
    # Logarithms: f and m stay positive, and steps are relative.
    logs = torch.tensor([math.log(5.2 * mm), math.log(0.5)], dtype=torch.float64, requires_grad=True)
    optimiser = torch.optim.LBFGS(
        [logs], line_search_fn="strong_wolfe", max_iter=60, tolerance_grad=1e-12, tolerance_change=1e-14
    )

    def show(name):
        with torch.no_grad():
            focal_length, magnification = torch.exp(logs)
            found = contrasts(torch, focal_length, magnification)
        told = ", ".join(f"{c:.3f} at {f / 1e3:.0f}/mm" for c, f in zip(found.tolist(), WANTED, strict=True))
        print(
            f"{name}: f = {float(focal_length) / mm:.3f} mm, m = {float(magnification):.3f}: contrast {told}"
        )

    def loss():
        optimiser.zero_grad()
        off = ((contrasts(torch, *torch.exp(logs)) - wanted) ** 2).sum()
        off.backward()
        return off

    show("before")
    optimiser.step(loss)
    show("after ")
    print("wanted:", ", ".join(f"{c:.3f} at {f / 1e3:.0f}/mm" for f, c in WANTED.items()))
    found = by_hand(*torch.exp(logs).tolist())
    print("closed forms give for the result:", ", ".join(f"{contrast:.3f}" for contrast in found))


if __name__ == "__main__":
    main()
