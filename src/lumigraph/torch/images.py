"""Raw images of points and of planes by PyTorch, through the lines of `lumigraph.operators.lenslets`.

Sampling is decided there, from plain numbers. Light is computed anew on the way back, of some points at a
time, so that memory does not grow with their number.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import torch

from lumigraph.core import arrays
from lumigraph.errors import GeometryError
from lumigraph.operators.lenslets.film_plane import FilmPlane
from lumigraph.operators.lenslets.gradient import Moved, both
from lumigraph.operators.lenslets.part_plane import TOGETHER, CellImages, PartPlane
from lumigraph.operators.lenslets.plane_of_points import PlaneOfPoints
from lumigraph.operators.lenslets.point_images import PointImages
from lumigraph.operators.lenslets.sampled_camera import SampledCamera, SourcePoint
from lumigraph.operators.lenslets.whole_planes import WholePlane
from lumigraph.operators.sampling.tiles import as_plane
from lumigraph.propagation.window import smooth_size
from lumigraph.scene import Points
from lumigraph.torch.expansion import Expansion, Numbers, again
from lumigraph.torch.library import TorchLibrary
from lumigraph.torch.operator import applied

Expand = Callable[[SampledCamera, Sequence[Any]], Expansion]
"""Numbers of a camera and of pairs by the keys, to first order."""


class PointLight:
    """Images of points before a camera, one by one.

    Parameters
    ----------
    expansion
        Numbers of the camera by its keys.
    sources
        The points.
    moved
        Where they are before the cameras of each pair.
    """

    def __init__(
        self, expansion: Expansion, sources: Sequence[SourcePoint], moved: Sequence[Moved | None]
    ) -> None:
        self.expansion, self.own, self.moved = expansion, expansion.own, moved
        self.xp = TorchLibrary(expansion.device)
        self.prepared = expansion.prepared(self.xp, sources)

    def intensity(self, source: SourcePoint, places: torch.Tensor | None = None) -> torch.Tensor:
        """Intensity (y, x) of a point of 1; it changes with the point's places (3,), which are zeros."""
        numbers = self.expansion.of_point(source, self.moved)
        if places is not None:
            numbers = self._beside(numbers, source, places)
        light = self.own.light(self.xp, numbers, source)  # type: ignore[arg-type]  # a library
        lit = self.own.lenslets.lit(light.detach().cpu().numpy(), source.lit.cells)
        field = self.own.lenslets.amplitude(self.xp, self.prepared, light, source.lit.cells, lit)
        return field.real**2 + field.imag**2

    def bright(self, source: SourcePoint) -> torch.Tensor:
        """Intensity of a point, as the pairs' lenses see it."""
        pairs = zip(self.expansion.ends, self.moved, strict=True)
        ends = [[one.intensity for _, one in both(source, *pair)] for pair in pairs]
        return self.expansion.tensor(source.intensity, ((k, a, b) for k, (a, b) in enumerate(ends)))

    def _beside(self, numbers: Numbers, source: SourcePoint, places: torch.Tensor) -> Numbers:
        own = self.own
        if "aberrations" not in numbers or own._varies or own.optics.camera.objects is not None:
            raise GeometryError(
                "slopes by the places of points are known of paraxial cameras behind a thin lens that is the "
                "same for all fields. Give places without requires_grad."
            )
        phase = sum(
            places[k] * torch.as_tensor(down[:, None] + across, device=places.device)
            for k, (down, across) in enumerate(own.moves(source))
        )
        farther = places[2] / (own.optics.camera.object_distance + source.dz)
        return {
            **numbers,
            "aberrations": numbers["aberrations"] + phase,
            "strength": numbers["strength"] * (1 - farther),
        }


def of_points(
    images: PointImages, points: Points, x: torch.Tensor, expand: Expand, places: torch.Tensor | None = None
) -> torch.Tensor:
    """Raw images (k, ny, nx) of objects in which points are so many times as bright (k, points).

    Places (points, 3) are zeros that change as the points' own do.
    """
    own, mine, moved = images.before(points)
    expansion = expand(own, images.ends(own))
    sources = [one for one in own.sources(mine) if bool((x[:, one.number] != 0).any()) or x.requires_grad]
    seen, light = PointLight(expansion, sources, moved), x.new_zeros(len(x), *own.shape)

    def image(source: SourcePoint, bright: torch.Tensor) -> torch.Tensor:
        at = None if places is None else places[source.number]
        return (seen.bright(source) * bright)[:, None, None] * seen.intensity(source, at)

    for source in sources:
        window = (slice(None), *source.window)
        light[window] = light[window] + again(partial(image, source), x[:, source.number])
    return _read(expansion, light)


def of_plane(plane: WholePlane, x: torch.Tensor, expand: Expand) -> torch.Tensor:
    """Raw images (k, ny, nx) of objects (k, y, x) in a plane."""
    if isinstance(plane, PlaneOfPoints):
        flat = x.flatten(1)[:, torch.as_tensor(plane._order.copy(), device=x.device)]
        plane._check(len(x), int((flat != 0).any(0).sum()))
        return of_points(plane._as_bright, plane._points, flat, expand)
    if isinstance(plane, PartPlane):
        return _repeated(plane, x, expand)
    if isinstance(plane, FilmPlane):
        return _convolved(plane, x, expand)
    raise GeometryError(f"{type(plane).__name__} has no images by PyTorch.")


def _repeated(plane: PartPlane, x: torch.Tensor, expand: Expand) -> torch.Tensor:
    """Raw images behind lenslets from cell to cell of which images repeat themselves."""
    whole, spots = expand(plane._here, plane._seen), plane._spots
    seen = PointLight(expand(plane._own, plane._ends), spots, plane._moved)
    points = torch.stack([_spread(plane, whole, one) for one in x])
    cells = whole.own.optics.cells
    shape = (len(x), *cells.count, cells.samples[0] * cells.samples[1])
    light = x.new_zeros(shape)
    for k in range(0, len(spots), TOGETHER):
        block = CellImages.around(plane._own, spots[k : k + TOGETHER], plane._margin)

        def images(points: torch.Tensor, block: CellImages = block) -> torch.Tensor:
            each = [seen.bright(one) * seen.intensity(one) for one in block.sources]
            return _added(block, _kernel(block, each), points, shape)

        light = light + again(images, points)
    (ry, rx) = cells.ring
    framed = torch.nn.functional.pad(light, (0, 0, rx, rx, ry, ry))
    return _read(whole, torch.stack([as_plane(one, cells, cells.samples) for one in framed]))


def _spread(plane: PartPlane | FilmPlane, whole: Expansion, x: torch.Tensor) -> torch.Tensor:
    """Light of an object's samples (y, x) on the points of all cells, or on the samples of the image."""
    known: dict[Any, SampledCamera] = {}

    def of(end: SampledCamera) -> SampledCamera:
        optics = plane._optics(end) if isinstance(plane, PartPlane) else end.optics
        camera = optics.camera
        scale = camera.separation / (camera.object_distance + plane.dz)
        cells = optics.cells if isinstance(plane, PartPlane) else None
        return known.setdefault((cells, scale, optics.rotation), end)

    spread: Any = plane._points  # takes tensors, too
    return whole.linear(x, of, spread)


def _kernel(block: CellImages, images: Sequence[torch.Tensor]) -> torch.Tensor:
    """Images of some points of a cell, tile by tile (rows, columns, n, samples)."""
    size, samples, each = [len(cells) for cells in block._cells], block.own.optics.cells.samples, []
    for source, image in zip(block.sources, images, strict=True):
        tiles = arrays.tiled(image, samples).flatten(2)
        (low, high), (left, right) = (
            (part.start, n - part.stop) for part, n in zip(block._inside(source), size, strict=True)
        )
        each.append(torch.nn.functional.pad(tiles, (0, 0, left, right, low, high)))
    return torch.stack(each, 2)


def _added(
    block: CellImages, kernel: torch.Tensor, points: torch.Tensor, shape: tuple[int, ...]
) -> torch.Tensor:
    """Light (k, rows, columns, samples) of points (k, rows, columns, points) through a block's images."""
    light, (rows, columns) = points.new_zeros(shape), kernel.shape[:2]
    for row in range(rows):  # all columns in one product: shifted views of the points beside each other
        y, last = block._from((row, columns - 1), shape[1:])
        seen = points[:, y, last.start : last.stop + columns - 1, block.numbers]
        beside = seen.unfold(2, columns, 1)  # (k, rows, columns, n, cells to the left, the farthest first)
        light = light + torch.einsum("kyxnj,jns->kyxs", beside, kernel[row].flip(0))
    return light


def _convolved(plane: FilmPlane, x: torch.Tensor, expand: Expand) -> torch.Tensor:
    """Raw images without lenslets: one convolution with the image of a point."""
    (sight, source), whole = plane._point, expand(plane._own, plane._ends)
    none: list[Moved | None] = [None] * len(plane._around)
    seen = PointLight(expand(sight, plane._around), [source], none)
    kernel = again(lambda: seen.intensity(source))
    points = torch.stack([_spread(plane, whole, one) for one in x])
    window = [smooth_size(n) for n in points.shape[1:]]
    spectrum = torch.fft.rfft2(points, s=window) * torch.fft.rfft2(kernel, s=window)
    y, x_ = (n - 1 for n in kernel.shape)
    wide, high = points.shape[2], points.shape[1]
    return _read(whole, torch.fft.irfft2(spectrum, s=window)[:, y:high, x_:wide])


def _read(expansion: Expansion, light: torch.Tensor) -> torch.Tensor:
    """Means over pixels (k, ny, nx) of the image's samples (k, y, x)."""
    return torch.stack([expansion.linear(one, lambda end: end.read, applied) for one in light])
