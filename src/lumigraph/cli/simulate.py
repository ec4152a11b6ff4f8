"""`lumigraph simulate`."""

import warnings
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from lumigraph.cli import files
from lumigraph.cli.console import progress
from lumigraph.cli.options import Output, length, lengths, section
from lumigraph.cli.reporting import REPORTED, ReportOptions
from lumigraph.core.result import Figure, Quantity, Result
from lumigraph.errors import FormatError, GeometryError, ParaxialWarning

if TYPE_CHECKING:
    from collections.abc import Iterator

    from lumigraph.core.grid import Grid
    from lumigraph.core.raw import RawImage
    from lumigraph.instruments import Instrument
    from lumigraph.scene import Medium, Scene

SCENES = (
    "white",
    "usaf1951",
    "siemens_star",
    "gratings",
    "slanted_edge",
    "edge",
    "pinhole",
    "chessboard",
    "photo",
)
_FINEST_GROUP = 12
_PARAXIAL = 0.01
"""Error of parabolic lenses, relative rms, from which a warning says what the result states in any case."""
_COUNTS = {"snapshots": 100, "tilted": 64}


@Parameter(name="*", group=section("Light"))
@dataclass(frozen=True)
class LightOptions:
    """Coherence and spectrum of the scene's light.

    Parameters
    ----------
    coherence
        incoherent: like every lit scene; coherent: one plane wave; snapshots: random phases, many
        times; tilted: plane waves from many directions; partial: a round lamp of aperture --na, whose light
        converges on the main lens, by coherent modes.
    accuracy
        Relative rms error to reach with incoherent light, 0.01 to 0.00001, or of the lamp's modes; 0.001 if
        left out. The raw image records the error reached; a warning says when that is more.
    count
        Snapshots (100 if left out) or tilted waves (64) to add up: more of them, less speckle.
    na
        Numerical aperture of the tilted waves, all directions if left out; or of the lamp of partial.
    wavelength
        Wavelength instead of the camera's own, such as '550 nm'. May be repeated: the raw image is the sum;
        with --colours three are red, green and blue.
    colours
        rgb: a colour raw image; or a Bayer pattern, such as RGGB. The scene's pictures keep their colours.
    filters
        Curves in the place of --wavelength: a CSV file with the columns 'wavelength [nm]', 'response' or
        'red', 'green' and 'blue', and 'light' where that is not even. Each channel takes as many
        wavelengths as keep its degree of coherence to 0.01.
    """

    coherence: Literal["incoherent", "coherent", "snapshots", "tilted", "partial"] = "incoherent"
    accuracy: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None
    count: Annotated[int | None, Parameter(allow_leading_hyphen=True)] = None
    na: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None
    wavelength: list[str] | None = None
    colours: Literal["rgb", "RGGB", "GRBG", "GBRG", "BGGR"] | None = None
    filters: Path | None = None

    def spectrum(self, camera: "Instrument") -> Any:
        """The wavelengths that `lumigraph.simulate` takes, or None for the camera's."""
        from lumigraph.simulation import Spectrum

        if self.filters is not None:
            if self.wavelength:
                raise FormatError("--filters and --wavelength both give wavelengths. Leave one out.")
            bayer = None if self.colours == "rgb" else self.colours
            return Spectrum.load(self.filters, camera.path_difference, bayer=bayer)
        wavelengths = tuple(length("--wavelength", text) or 0.0 for text in self.wavelength or [])
        if self.colours is None:
            return Spectrum(wavelengths, ((1.0,),) * len(wavelengths)) if wavelengths else None
        if len(wavelengths) not in (0, 3):
            raise FormatError(f"--colours takes 3 --wavelength, red, green and blue, not {len(wavelengths)}.")
        return Spectrum.rgb(*wavelengths, bayer=None if self.colours == "rgb" else self.colours)

    def chosen(self, seed: int, camera: "Instrument") -> Any:
        """The coherence that `lumigraph.simulate` takes, before a camera."""
        from lumigraph import simulation

        if self.coherence == "partial" and self.count is None:
            return self._lamp(camera)
        if self.count is not None and self.coherence not in _COUNTS:
            raise FormatError(
                f"--count has no meaning with --coherence {self.coherence}. Leave it out, or use snapshots."
            )
        if self.accuracy is not None and self.coherence not in ("incoherent", "partial"):
            raise FormatError(f"--accuracy has no meaning with --coherence {self.coherence}. Leave it out.")
        if self.coherence == "coherent":
            return simulation.Coherent()
        if self.na is not None and self.coherence != "tilted":
            raise FormatError(
                f"--na has no meaning with --coherence {self.coherence}. Use --coherence tilted."
            )
        if self.coherence == "incoherent":
            return simulation.Incoherent() if self.accuracy is None else simulation.Incoherent(self.accuracy)
        count = _COUNTS[self.coherence] if self.count is None else self.count
        if count < 1:
            raise FormatError(f"--count is {count} but must be at least 1.")
        if self.coherence == "tilted":
            return simulation.TiltedWaves(count, self.na)
        return simulation.Snapshots(count, rng=seed)

    @contextmanager
    def unasked(self) -> "Iterator[None]":
        """True without --accuracy: the result then only states the error of parabolic lenses."""
        with warnings.catch_warnings():
            if self.accuracy is None:
                warnings.simplefilter("ignore", ParaxialWarning)
            yield

    def warn_of(self, paraxial: float) -> None:
        """Warn of parabolic lenses that are far off, though no --accuracy was given."""
        if self.accuracy is None and paraxial > _PARAXIAL:
            warnings.warn(
                f"parabolic lenses put the raw image off by some {100 * paraxial:.2g} % rms. With square "
                'lenslets, model = "exact" in the camera file goes beyond them.',
                ParaxialWarning,
                stacklevel=3,
            )

    def _lamp(self, camera: "Instrument") -> Any:
        """A round lamp, imaged into the main lens."""
        from lumigraph import simulation
        from lumigraph.instruments.capabilities import WithMainLens
        from lumigraph.scene import ExtendedSource

        if self.na is None:
            raise FormatError("--coherence partial needs --na, the numerical aperture of the lamp.")
        if not isinstance(camera, WithMainLens):
            raise FormatError("--coherence partial is for cameras: microscopes image fluorescence.")
        lamp = ExtendedSource.disc(self.na, -camera.object_distance)
        return simulation.PartiallyCoherent(lamp, 1e-3 if self.accuracy is None else self.accuracy)


@Parameter(name="*", group=section("Scene"))
@dataclass(frozen=True)
class SceneOptions:
    """Scene in front of the camera.

    Parameters
    ----------
    scene
        white, usaf1951, siemens_star, gratings, slanted_edge, edge, pinhole, chessboard, photo, a picture
        file, or a scene of the renderer Mitsuba 3 (.xml, lengths in metres), whose sensor the main lens takes
        the place of. May be given several times.
    depth
        Depth of each scene from the focused plane, such as '10 mm' (farther) or '-10 mm' (nearer). With
        --depth-map two: of white, and of black.
    depth_map
        Depths of the one picture that is given as --scene, which then hides what is behind it: metres from
        the focused plane (.pfm, .tiff), or a picture, white for the first --depth and black for the second.
    planes
        Opaque slices that --depth-map is sorted into, 1 to 64; 8 if left out; or a rendered scene, 16.
    medium
        Refracting volume before the scene, for light-field microscopes: refractive indices (OME-TIFF,
        .zarr, .h5), as --medium-index says. Each point and each lit sample then has an image of its own.
    medium_depth
        Displacement of the volume's depths, such as '-20 um' (nearer to the objective).
    medium_index
        difference: indices less that of the objective's medium; absolute: indices, such as 1.37.
    point
        A point of light at 'y, x' or 'y, x, depth' in object space, such as '0 mm, 1 mm, 5 mm'; may be
        given several times.
    """

    scene: list[str] | None = None
    depth: Annotated[list[str] | None, Parameter(allow_leading_hyphen=True)] = None
    depth_map: Path | None = None
    planes: Annotated[int | None, Parameter(allow_leading_hyphen=True)] = None
    medium: Path | None = None
    medium_depth: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None
    medium_index: Literal["difference", "absolute"] = "difference"
    point: Annotated[list[str] | None, Parameter(allow_leading_hyphen=True)] = None

    def check(self) -> None:
        """Refuse what can be seen to be wrong before the camera is known."""
        if not self.scene and not self.point:
            raise FormatError(
                f"nothing is in front of the camera. Give --scene ({', '.join(SCENES)}) or --point."
            )
        if self.medium is None and (self.medium_depth is not None or self.medium_index != "difference"):
            raise FormatError("--medium-depth and --medium-index have no meaning without --medium.")
        if self.planes is not None and self.depth_map is None and not self._rendered():
            raise FormatError(
                "--planes has no meaning without --depth-map or a rendered scene. Leave it out."
            )
        if self.depth_map is not None:
            if len(self.scene or []) != 1:
                raise FormatError(f"--depth-map is of one --scene, not {len(self.scene or [])}. Give one.")
            if len(self._depths()) not in (0, 2):
                raise FormatError(
                    f"--depth-map takes 2 --depth, of white and of black, not {len(self._depths())}."
                )
        elif len(self._depths()) not in (0, 1, len(self.scene or [])):
            raise FormatError(
                f"there are {len(self._depths())} --depth for {len(self.scene or [])} --scene. "
                "Give one for each."
            )

    def _depths(self) -> list[float]:
        return lengths("--depth", self.depth)

    def _rendered(self) -> bool:
        return any(name.endswith(".xml") for name in self.scene or [])

    def built(self, camera: "Instrument", *, colour: bool = False, seed: int = 0) -> "Scene":
        """Everything together, before a camera; rendered scenes in colour or grey, from rays of a seed."""
        from lumigraph.scene import Scene, targets

        grid, names = camera.scene_grid, self.scene or []
        if self.depth_map is not None:
            lit = self._with_depths(camera, self.depth_map)
            return lit + targets.points([_point(text) for text in self.point]) if self.point else lit
        depths = (self._depths() or [0.0]) * (len(names) if len(self._depths()) < 2 else 1)
        parts = [
            (self._raytraced(name, camera, colour, seed) if name.endswith(".xml") else _scene(name, grid)).at(
                dz
            )
            for name, dz in zip(names, depths, strict=True)
        ]
        if self.point:
            parts.append(targets.points([_point(text) for text in self.point]))
        return sum(parts, Scene())

    def _raytraced(self, name: str, camera: "Instrument", colour: bool, seed: int) -> "Scene":
        """Layers of a rendered scene."""
        from lumigraph.instruments.capabilities import WithMainLens
        from lumigraph.scene import mitsuba

        if not isinstance(camera, WithMainLens):
            raise FormatError(f"--scene {name} is for cameras: before a microscope there is no main lens.")
        planes = 16 if self.planes is None else self.planes
        with progress("render") as shown:
            return mitsuba(name, camera, planes=planes, colour=colour, seed=seed, progress=shown).scene

    def refracting(self, camera: "Instrument") -> "Medium | None":
        """Medium through which the scene is imaged."""
        if self.medium is None:
            return None
        from dataclasses import replace

        from lumigraph import io
        from lumigraph.core.volume import Volume
        from lumigraph.instruments.capabilities import WithObjective
        from lumigraph.scene import Medium

        volume = io.open(self.medium)
        if not isinstance(volume, Volume):
            raise FormatError(
                f"--medium {self.medium} holds a {type(volume).__name__} but must be a volume: planes with "
                "their depths and the size of a sample."
            )
        if not isinstance(camera, WithObjective):
            raise FormatError("--medium is of light-field microscopes: before a camera leave it out.")
        moved = length("--medium-depth", self.medium_depth) or 0.0
        data = volume.data
        if self.medium_index == "absolute":
            data = data - camera.objectives[0].medium
        return Medium.of_index(replace(volume, data=data, depths=tuple(z + moved for z in volume.depths)))

    def _with_depths(self, camera: "Instrument", path: Path) -> "Scene":
        """The one picture as opaque slices at the depths of a map, which is resized with it."""
        import numpy as np

        from lumigraph.preparation.given import read_raw
        from lumigraph.scene import Slice, targets
        from lumigraph.scene.rgbd import SeeingCamera

        (picture,) = (p for p in _scene((self.scene or [""])[0], camera.scene_grid).parts)
        if not isinstance(picture, Slice) or not isinstance(camera, SeeingCamera):
            raise FormatError("--depth-map is of a picture before a camera with a main lens.")
        values = read_raw(path).data
        if values.ndim != 2:
            raise FormatError(f"--depth-map {path} has shape {values.shape} but must be grey (y, x).")
        if self.depth:
            white, black = self._depths()
            highest = np.iinfo(values.dtype).max if values.dtype.kind in "iu" else 1.0
            values = black + (white - black) * (values / highest)
        elif values.dtype.kind in "iu":
            raise FormatError(
                f"--depth-map {path} holds whole numbers, not metres. Give two --depth, of white and of "
                "black."
            )
        rows, columns = (
            np.floor((np.arange(n) + 0.5) * m / n).astype(int)
            for n, m in zip(picture.grid.shape, values.shape, strict=True)
        )
        planes = 8 if self.planes is None else self.planes
        return targets.rgbd(picture.intensity, values[np.ix_(rows, columns)], picture.grid, camera, planes)


def simulate(
    camera: str,
    /,
    *,
    output: Output,
    stage: SceneOptions = SceneOptions(),
    light: LightOptions = LightOptions(),
    seed: int = 0,
    noise: Annotated[bool, Parameter(negative="")] = False,
    common: ReportOptions = REPORTED,
) -> Result:
    """Simulate the raw image of a scene by wave optics.

    Writes intensities (TIFF and Zarr: floats, 1 for an even scene; PNG: scaled), or with --noise what the
    sensor reads out, in whole numbers.

    Example: `lumigraph simulate camera.toml --scene usaf1951 --depth "10 mm" -o raw.tiff`

    Parameters
    ----------
    camera
        Camera file (TOML), or the name of a bundled one such as thesis-plenoptic-1.
    output
        Raw image (.tiff, .png, .zarr, .zarr.zip).
    seed
        Seed of the random numbers: the same seed gives the same raw image.
    noise
        Expose the sensor: photon noise, read noise, whole numbers of its bits.
    """
    from lumigraph import io
    from lumigraph.instruments import load_camera
    from lumigraph.simulation import Interrupted, simulate

    common.check()
    files.check_output(output, files.PICTURES)
    stage.check()
    if seed < 0:
        raise FormatError(f"--seed is {seed} but must be at least 0.")
    described = load_camera(camera)
    coherence, spectrum = light.chosen(seed, described), light.spectrum(described)
    scene = stage.built(described, colour=light.colours is not None, seed=seed)
    medium = stage.refracting(described)
    try:
        with progress("simulate") as shown, light.unasked():
            raw = simulate(described, scene, coherence, spectrum=spectrum, progress=shown, medium=medium)
    except Interrupted as stopped:
        kept = output.with_name(f"{output.name.split('.')[0]}.partial{''.join(output.suffixes)}")
        io.save(stopped.partial, kept)
        raise KeyboardInterrupt(f"what was finished is in {kept}.") from None
    if noise:
        import numpy as np

        exposed = described.sensor.expose(raw.data, rng=np.random.default_rng(seed))
        raw = type(raw)(
            exposed.data,
            exposed.pixel_pitch,
            exposed.bit_depth,
            raw.bayer,
            {**raw.metadata, **exposed.metadata},
        )
    io.save(raw, output)
    (rows, columns), error = raw.shape, raw.metadata.get("estimated_error")
    unit = "" if noise else "of an even scene"
    mean, largest = float(raw.data.mean()), float(raw.data.max())
    lines = [f"{rows} x {columns} px, mean {mean:.4g}, largest {largest:.4g}"]
    if error is not None:
        lines.append(f"estimated error {100 * error:.2g} % rms, from the difference of two halves")
    if paraxial := raw.metadata.get("error", {}).get("paraxial"):
        lines.append(f"by parabolic lenses, which are off by some {100 * paraxial:.2g} % rms")
        light.warn_of(paraxial)
    values = (
        Quantity("shape", raw.shape, "px"), Quantity("mean", mean, unit), Quantity("largest", largest),
        Quantity("pixel_pitch", raw.pixel_pitch, "m"), Quantity("estimated_error", error),
        Quantity("coherence", light.coherence),
    )  # fmt: skip
    table = described.describe()
    return Result(
        "Simulate", f"Raw image of a {table.title}.", raw, tuple(lines), values,
        lambda: _figures(raw, described), tuple(table.warnings), (output,),
    )  # fmt: skip


def _figures(raw: "RawImage", camera: "Instrument") -> "Iterator[Figure]":
    from lumigraph import plots

    yield Figure(raw, "Upright, as a camera reads it out.", "Raw image", {"wide": True})
    rows, columns = (slice(max(0, n // 2 - 80), n // 2 + 80) for n in raw.shape)
    yield Figure(raw.data[rows, columns], "The middle, pixel by pixel.", "Raw image", {"zoom": 3})
    yield Figure(plots.layout(camera), f"Rays through the {camera.noun}.", "Camera")
    yield Figure(camera.to_toml(), section="Camera file")


def _scene(name: str, grid: "Grid") -> "Scene":
    from lumigraph.scene import targets

    if name == "white":
        return targets.white()
    if name == "usaf1951":
        return _largest_chart(grid)
    if name in SCENES:
        return getattr(targets, name)(grid)
    if "." not in name and "/" not in name:
        raise FormatError(f"--scene {name!r} is unknown. Use {', '.join(SCENES)}, or a picture file.")
    from lumigraph.preparation.given import read_raw

    return targets.photo(grid, read_raw(Path(name)).data)


def _largest_chart(grid: "Grid") -> "Scene":
    """Up to three groups of the USAF-1951 chart: the coarsest that fit, as far as samples resolve them."""
    from lumigraph.scene import targets

    for group in range(-2, _FINEST_GROUP):
        resolved = [g for g in (group + 1, group + 2) if targets.bar_width(g, 6) >= max(grid.pitch)]
        with suppress(GeometryError):
            return targets.usaf1951(grid, (group, max(resolved, default=group)))
    return targets.usaf1951(grid, (_FINEST_GROUP, _FINEST_GROUP))


def _point(text: str) -> tuple[float, ...]:
    words = text.split(",")
    if len(words) not in (2, 3):
        raise FormatError(f"--point {text!r} must be 'y, x' or 'y, x, depth', such as '0 mm, 1 mm, 5 mm'.")
    return tuple(length("--point", word) or 0.0 for word in words)
