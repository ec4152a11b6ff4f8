"""`Camera`: a camera as a PyTorch module, from points or scenes to raw images."""

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any

import numpy as np
import torch

from lumigraph.core import checks, upper_floors
from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError
from lumigraph.instruments import Camera as Described
from lumigraph.operators.lenslets.gradient import Both
from lumigraph.operators.lenslets.plane_of_points import plane_before
from lumigraph.operators.lenslets.point_images import PointImages
from lumigraph.operators.lenslets.sampled_camera import SampledCamera
from lumigraph.scene import Points
from lumigraph.torch.expansion import Expansion, first_order
from lumigraph.torch.images import of_plane, of_points
from lumigraph.torch.keys import Keys
from lumigraph.torch.noise import Exposure


class Camera(torch.nn.Module):
    """A camera as a layer: points or scenes to raw images, in incoherent light.

    Raw images are those of `lumigraph.simulate`: the same lines compute them, by PyTorch. Slopes reach the
    light of scenes and points, the points' places, and keys of the camera file.

    Parameters
    ----------
    camera
        A camera, with lenslets or without, its file, or a name of the catalogue.
    parameters
        Keys of the camera file, as `lumigraph optimise --vary` has them, that are parameters: a mapping to
        their ranges, such as ``{"lenslets.focal_length": "5 mm:5.4 mm"}``, or names alone for 5 % to either
        side of the camera's own value. They are `parts`, 0 at the low end of the range and 1 at the high
        one, and are put back onto the range where an optimiser leaves it. "main_lens.mask.phase" and
        "main_lens.mask.open", tables of control points, are `mask`, as the file has them.
    grid
        Samples of scenes; `camera.operator_grid()` if left out.
    depths
        Of a scene's planes from the focused one [m], positive farther.
    accuracy
        Relative rms error of points' images, 1e-3 to 1e-2.
    photons
        Photons that an intensity of 1 sends to a pixel: raw images are electrons then, with noise drawn by
        reparametrisation (`Exposure`) while the module trains, and without it after `eval()`.

    Raises
    ------
    FormatError
        A key that the file does not know, or a range that does not hold the camera's own value.
    GeometryError
        A microscope; by `forward`, a camera that `part_images` refuses, or tilted planes.

    Examples
    --------
    >>> import lumigraph as lg, torch
    >>> camera = lg.load_camera("thesis-plenoptic-2-m050").replace(
    ...     lenslets={"count": (7, 7)}, sensor={"shape": (61, 61)}, main_lens={"diameter": "1 mm"}
    ... )
    >>> model = lg.torch.Camera(camera, ["lenslets.focal_length", "object_distance"])
    >>> raw = model(torch.tensor([[[1e-5, 0.0, 2e-3, 1.0]]]))  # one image of one point: y, x, dz, light
    >>> (raw**2).sum().backward()
    >>> raw.shape, model.parts.grad.shape
    (torch.Size([1, 61, 61]), torch.Size([2]))
    """

    def __init__(
        self,
        camera: Described | str | PathLike[str],
        parameters: Sequence[str] | Mapping[str, str] = (),
        *,
        grid: Grid | None = None,
        depths: Sequence[float] = (0.0,),
        accuracy: float = 1e-3,
        photons: float | None = None,
    ) -> None:
        super().__init__()
        start = upper_floors.camera(camera)
        checks.instance("camera", start, Described)
        self.keys = Keys.of(start, parameters)
        self.parts = torch.nn.Parameter(torch.as_tensor(self.keys.own, dtype=torch.float64))
        points = {name: torch.as_tensor(table) for name, table in self.keys.points().items()}
        self.mask = torch.nn.ParameterDict(points)
        self.grid, self.depths, self.accuracy = grid, [float(dz) for dz in depths], accuracy
        self.exposure = None if photons is None else Exposure(start.sensor, photons)
        for dz in self.depths:
            start.defocused(dz)

    @property
    def names(self) -> list[str]:
        """Keys of the camera file that are parameters, in the order of `parts`."""
        return list(self.keys.ranges)

    @property
    def camera(self) -> Described:
        """The camera as it is now: ``model.camera.to_toml()`` is its file."""
        return self.keys.at(self._values(), self._masks(), pairs=False)[0]

    def values(self) -> dict[str, Any]:
        """Values of the keys, as a camera file has them."""
        return self.keys.item(self._values())

    def forward(self, scene: torch.Tensor | Points, generator: torch.Generator | None = None) -> torch.Tensor:
        """Raw images (batch, ny, nx).

        Parameters
        ----------
        scene
            Points (batch, n, 4), each y, x, dz [m] and its intensity; `lumigraph.Points`, a batch of one; or
            scenes (batch, depth, y, x), planes that shine at once on `grid` and `depths`.
        generator
            Of the noise.
        """
        asked = scene if isinstance(scene, torch.Tensor) else self._tensor(scene)
        given = asked.to(torch.float64)
        if given.ndim == 3 and given.shape[-1] == 4:
            images = self._images()
            raw = torch.stack([self._of_points(images, one) for one in given])
        elif given.ndim == 4:
            raw = self._of_scenes(given)
        else:
            raise GeometryError(
                f"scene has shape {tuple(asked.shape)} but must be points (batch, n, 4) or planes "
                "(batch, depth, y, x)."
            )
        if self.exposure is not None:
            raw = self.exposure(raw, generator) if self.training else self.exposure.mean(raw)
        return raw.to(asked.dtype)

    def _tensor(self, points: Points) -> torch.Tensor:
        """Points as a batch of one."""
        whole = np.column_stack([points.positions, points.intensities])
        return torch.as_tensor(whole, device=self.parts.device)[None]

    def _of_points(self, images: PointImages, given: torch.Tensor) -> torch.Tensor:
        plain, raws = given.detach().cpu().numpy(), []
        for dz in np.unique(plain[:, 2]):  # each depth is sampled as `simulate` samples it
            mine = np.flatnonzero(plain[:, 2] == dz)
            some, points = given[torch.as_tensor(mine)], Points(plain[mine, :3], np.ones(len(mine)))
            places = first_order(some[:, :3]) if given.requires_grad else None
            raws.append(of_points(images, points, some[None, :, 3], self._expand, places)[0])
        return torch.stack(raws).sum(0)

    def _of_scenes(self, given: torch.Tensor) -> torch.Tensor:
        grid, images = self.grid or self.keys.camera.operator_grid(), self._images()
        if tuple(given.shape[1:]) != (wanted := (len(self.depths), *grid.shape)):
            raise GeometryError(
                f"scenes have shape {tuple(given.shape[1:])} but depths and grid are {wanted}. Give depths= "
                "and grid= of the scenes."
            )
        planes = zip(self.depths, given.unbind(1), strict=True)
        raws = [of_plane(plane_before(images, grid, dz), one, self._expand) for dz, one in planes]
        return torch.stack(raws).sum(0)

    def _images(self) -> PointImages:
        wanted = torch.is_grad_enabled() and self.parts.requires_grad
        return self.keys.images(self._values(), self._masks(), self.accuracy, pairs=wanted)

    def _expand(self, own: SampledCamera, ends: Sequence[Both]) -> Expansion:
        moves = {name: points.double() - points.detach().double() for name, points in self.mask.items()}
        return Expansion(own, ends, self.parts.double(), self.keys.widths(self._values()), moves)

    def _masks(self) -> dict[str, np.ndarray]:
        """Control points of the masks; openings are put back onto 0 to 1."""
        with torch.no_grad():
            if "open" in self.mask:
                self.mask["open"].clamp_(0, 1)
        return {name: one.detach().double().cpu().numpy() for name, one in self.mask.items()}

    def _values(self) -> np.ndarray:
        with torch.no_grad():
            self.parts.clamp_(0, 1)
        return self.parts.detach().double().cpu().numpy().copy()
