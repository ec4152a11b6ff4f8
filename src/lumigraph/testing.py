"""Hypothesis strategies for the core nouns, for lumigraph's own tests and for those of its users.

Needs `hypothesis`. Sizes are small, odd and even, and rarely powers of two; arrays come from a drawn seed.
"""

import numpy as np
from hypothesis import strategies as st

from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.core.lattice import Lattice
from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import BAYER_PATTERNS, RawImage

__all__ = ["fields", "grids", "lattices", "light_fields", "raw_images"]

_SEEDS = st.integers(0, 2**32 - 1)


@st.composite
def grids(draw: st.DrawFn, min_side: int = 1, max_side: int = 24) -> Grid:
    """Grids of `min_side` to `max_side` samples per axis, 0.1 to 100 um apart, up to 1 mm off the axis."""
    side, pitch = st.integers(min_side, max_side), st.floats(1e-7, 1e-4)
    center = st.just(0.0) | st.floats(-1e-3, 1e-3)
    return Grid((draw(side), draw(side)), (draw(pitch), draw(pitch)), (draw(center), draw(center)))


@st.composite
def lattices(draw: st.DrawFn, pitch: float | None = None, *, strain: float = 0.02) -> Lattice:
    """Square and hexagonal lattices, turned by up to 30°, with up to `strain` of stretch and shear.

    The pitch [m] is drawn from 10 to 1000 um where it is not given.
    """
    size = draw(st.floats(1e-5, 1e-3)) if pitch is None else pitch
    rotation = draw(st.floats(-0.5, 0.5))
    origin = draw(st.floats(-2, 2)) * size, draw(st.floats(-2, 2)) * size
    if draw(st.booleans()):
        regular = Lattice.square(size, rotation, origin)
    else:
        regular = Lattice.hex(size, rotation, origin, kinds=draw(st.sampled_from((1, 3))))
    change = np.array([draw(st.floats(-strain, strain)) for _ in range(4)]).reshape(2, 2)
    basis = (np.eye(2) + change) @ np.array(regular.basis).T
    vectors = tuple((float(y), float(x)) for y, x in basis.T)
    return Lattice((vectors[0], vectors[1]), origin, regular.layout, regular.kinds)


@st.composite
def fields(draw: st.DrawFn, grid: Grid | None = None, *, single: bool = False) -> Field:
    """Random waves of unit variance, some with a batch axis; complex64 where `single`."""
    grid = draw(grids()) if grid is None else grid
    shape = draw(st.sampled_from(((), (2,)))) + grid.shape
    rng = np.random.default_rng(draw(_SEEDS))
    data = (rng.normal(size=shape) + 1j * rng.normal(size=shape)) / np.sqrt(2)
    return Field(data.astype(np.complex64 if single else np.complex128), grid, draw(st.floats(3e-7, 1e-6)))


@st.composite
def light_fields(draw: st.DrawFn, *, colour: bool | None = None) -> LightField:
    """Radiances from 0 to 1 of up to 5 × 5 views and 12 × 12 lenslets; grey or colour, or as asked."""
    aperture, lenslets = draw(grids(max_side=5)), draw(grids(max_side=12))
    colour = draw(st.booleans()) if colour is None else colour
    shape = aperture.shape + lenslets.shape + ((3,) if colour else ())
    rng = np.random.default_rng(draw(_SEEDS))
    return LightField(rng.random(shape), aperture, lenslets, draw(st.floats(1e-2, 1.0)))


@st.composite
def raw_images(draw: st.DrawFn, max_side: int = 32) -> RawImage:
    """Raw images of 8 to 16 bits or floats; grey, Bayer or colour; with and without a pixel pitch."""
    shape = (draw(st.integers(1, max_side)), draw(st.integers(1, max_side)))
    kind = draw(st.sampled_from(("grey", "bayer", "colour")))
    shape = (*shape, 3) if kind == "colour" else shape
    bits = draw(st.none() | st.integers(8, 16))
    rng = np.random.default_rng(draw(_SEEDS))
    if bits is None:
        data = rng.random(shape, np.float32)
    else:
        data = rng.integers(0, 2**bits, shape).astype(np.uint8 if bits == 8 else np.uint16)
    bayer = draw(st.sampled_from(BAYER_PATTERNS)) if kind == "bayer" else None
    return RawImage(data, draw(st.none() | st.floats(1e-6, 1e-5)), bits, bayer)
