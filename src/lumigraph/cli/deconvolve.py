"""`lumigraph deconvolve`."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from lumigraph.cli import files
from lumigraph.cli.console import stages
from lumigraph.cli.options import Output, above_zero, length
from lumigraph.cli.reporting import REPORTED, Reported, told
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    import numpy as np

    from lumigraph.core.calibration import Calibration
    from lumigraph.core.raw import RawImage
    from lumigraph.deconvolution import Step

MOST_DEPTHS = 1000


@Parameter(name="*")
@dataclass(frozen=True)
class Seen:
    """What is known of the raw image.

    Parameters
    ----------
    white
        White image: a microscope's lenslets are found on it, and its vignetting is taken into account.
    dark
        Dark image: what pixels read without light.
    background
        Value that every pixel reads without light, if there is no dark image.
    calibration
        File made by 'lumigraph calibrate', instead of the lenslets found on the white image.
    """

    white: Path | None = None
    dark: Path | None = None
    background: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None
    calibration: Path | None = None

    def lenslets(self, raw: "RawImage") -> "Calibration | None":
        """Where the micro-images are, compared with what the raw image shows; None if nothing tells."""
        from lumigraph import calibration as verbs
        from lumigraph.core.drift import check_drift

        if self.calibration is not None:
            found = files.read_calibration(self.calibration)
        elif self.white is not None:
            found = verbs.calibrate(files.read_raw(self.white))
        else:
            return None
        found.check_fits(raw.shape)
        check_drift(raw.data, found)
        return found

    def exposure(self, raw: "RawImage", calibration: "Calibration | None") -> Any:
        """Background and vignetting, and the noise that the file tells."""
        from lumigraph.deconvolution import Exposure

        if self.dark is not None and self.background is not None:
            raise FormatError("--dark and --background say the same. Give one of them.")
        known: dict[str, Any] = {}
        if self.background is not None:
            if not (math.isfinite(self.background) and self.background >= 0):
                raise FormatError(f"--background is {self.background:g} but must be at least 0.")
            known["background"] = self.background
        if self.dark is not None:
            known["background"] = _plane("--dark", self.dark, raw)
        if self.white is not None and calibration is not None:
            white = _plane("--white", self.white, raw)
            known["response"] = vignetting(white - known.get("background", 0.0), calibration.lattice.pitch)
        return Exposure.of(raw, **known)


@Parameter(name="*")
@dataclass(frozen=True)
class Wanted:
    """Where objects are looked for.

    Parameters
    ----------
    z
        Depths from the focused plane, positive farther: '-20 um:20 um:2 um' (first, last, step), or some,
        parted by commas; the focused plane if left out.
    samples
        Object samples along each lenslet.
    """

    z: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None
    samples: Annotated[int | None, Parameter(allow_leading_hyphen=True)] = None

    def depths(self) -> tuple[float, ...] | None:
        """Depths [m]."""
        if self.samples is not None and self.samples < 1:
            raise FormatError(f"--samples is {self.samples} but must be at least 1.")
        return None if self.z is None else depths("--z", self.z)


@Parameter(name="*")
@dataclass(frozen=True)
class Way:
    """How it is done.

    Parameters
    ----------
    iterations
        Of Richardson-Lucy, at most.
    prior
        none; tv: even but for edges (total variation); wavelets: few coefficients that are not noise.
    strength
        Of the prior: from 0.001 for bright images to 0.1 for dim ones.
    accelerated
        Momentum: as likely in a third of the iterations.
    deviance
        Stop where the deviance per pixel falls to this: to 1 for raw images of 'simulate --noise', whose
        electrons are known.
    raw_lattice
        Leave out the low-pass that keeps squares as large as lenslets out of a microscope's volumes.
    checkpoint
        File (.npz) from which a killed run goes on.
    """

    iterations: Annotated[int, Parameter(allow_leading_hyphen=True)] = 30
    prior: Literal["none", "tv", "wavelets"] = "none"
    strength: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None
    accelerated: Annotated[bool, Parameter(negative="")] = False
    deviance: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None
    raw_lattice: Annotated[bool, Parameter(negative="")] = False
    checkpoint: Path | None = None

    def check(self) -> None:
        """Refuse what can be seen to be wrong before anything is read."""
        if self.iterations < 1:
            raise FormatError(f"--iterations is {self.iterations} but must be at least 1.")
        if self.strength is not None and self.prior == "none":
            raise FormatError("--strength is that of a prior. Give --prior tv or --prior wavelets.")
        above_zero("--strength", self.strength)
        above_zero("--deviance", self.deviance)

    def method(self, camera: Any, operator: Any) -> Any:
        """`RichardsonLucy` with what was asked for."""
        from lumigraph.deconvolution import LowPass, RichardsonLucy, TotalVariation, Wavelets
        from lumigraph.deconvolution.filters import widths_of

        given: dict[str, Any] = {} if self.strength is None else {"strength": self.strength}
        prior = {"none": None, "tv": TotalVariation(**given), "wavelets": Wavelets(**given)}[self.prior]
        smooth = None
        if hasattr(camera, "low_pass_distances") and not self.raw_lattice:
            distances = camera.low_pass_distances(operator.depths)
            smooth = LowPass(widths_of(distances, operator.object_grid.pitch[0]))
        return RichardsonLucy(prior, smooth, accelerated=self.accelerated)


def deconvolve(
    raw: Path,
    /,
    *,
    output: Output,
    camera: str,
    seen: Seen = Seen(),
    wanted: Wanted = Wanted(),
    way: Way = Way(),
    common: Reported = REPORTED,
) -> None:
    """Reconstruct what was in front of a microscope or a camera from one raw image.

    A light-field microscope gives a volume, a focused camera the picture of its main lens, or one for each
    of several depths. Ctrl-C writes what was reached.

    Example: `lumigraph deconvolve raw.tif --white white.tif --dark dark.tif --camera scope.toml --z "-20 um:20 um:2 um" -o volume.ome.tif`

    Parameters
    ----------
    raw
        Raw image (TIFF, PNG, Zarr), as it was read.
    output
        Volume (.ome.tif, .ome.zarr, .h5) or picture (.tiff, .png, .zarr).
    camera
        Camera file (TOML), or the name of a bundled one.
    """  # noqa: E501 - an example is one line
    from lumigraph import io
    from lumigraph.deconvolution import Interrupted, Stop
    from lumigraph.deconvolution import deconvolve as run
    from lumigraph.instruments import load_camera

    files.check_output(output, (*files.PICTURES, ".h5", ".hdf5"))
    common.check()
    way.check()
    wanted_depths, described = wanted.depths(), load_camera(camera)
    picture = files.read_raw(raw)
    steps: list[Step] = []
    with stages("deconvolve") as shown:
        calibration = seen.lenslets(picture)
        exposure = seen.exposure(picture, calibration)
        shown("point images", 0.0)
        operator = operator_of(described, wanted_depths, wanted.samples, calibration)

        def follow(step: "Step") -> None:
            steps.append(step)
            shown(f"deviance {step.deviance:.4g} per pixel", step.iteration / step.iterations)

        try:
            found = run(
                picture, operator, Stop(way.iterations, way.deviance), method=way.method(described, operator),
                exposure=exposure, progress=follow, checkpoint=way.checkpoint,
            )  # fmt: skip
        except Interrupted as stopped:
            kept = output.with_name(f"{output.name.split('.')[0]}.partial{''.join(output.suffixes)}")
            io.save(stopped.partial, kept)
            raise KeyboardInterrupt(f"{stopped.iterations} iterations are in {kept}.") from None
    io.save(found, output)
    values = _values(found, steps, output)
    numbers = [(name.replace("_", " "), _shown(name, value)) for name, value in values.items()]
    told(common, _text(values), values, lambda: _page(found, picture, steps), numbers)


def depths(option: str, text: str) -> tuple[float, ...]:
    """Depths [m] written as 'first:last:step' or parted by commas.

    Raises
    ------
    FormatError
        No lengths, a step that does not lead from the first to the last, or more than `MOST_DEPTHS`.

    >>> [round(dz * 1e6, 6) for dz in depths("--z", "-2 um:3 um:2 um")]
    [-2.0, 0.0, 2.0]
    >>> depths("--z", "-20 um:20 um:2 um")[10]
    0.0
    """
    if ":" not in text:
        found = sorted(length(option, part.strip()) or 0.0 for part in text.split(","))
        if len(set(found)) < len(found):
            raise FormatError(f"{option} {text!r} names a depth twice.")
        return tuple(found)
    parts = [length(option, part.strip()) or 0.0 for part in text.split(":")]
    if len(parts) != 3:
        raise FormatError(f"{option} is {text!r} but must be 'first:last:step', such as '-20 um:20 um:2 um'.")
    first, last, step = parts
    if step <= 0 or last < first:
        raise FormatError(
            f"{option} {text!r} must ascend: its step must be above 0, its last after its first."
        )
    count = (last - first) / step * (1 + 1e-9) + 1
    if count > MOST_DEPTHS:
        raise FormatError(f"{option} {text!r} asks for {count:.3g} depths; at most {MOST_DEPTHS} are taken.")
    planes = (first + k * step for k in range(int(count)))
    return tuple(0.0 if abs(dz) < 1e-9 * step else dz for dz in planes)  # no 1.7e-21 for the focused plane


def operator_of(
    camera: Any, planes: tuple[float, ...] | None, samples: int | None, calibration: "Calibration | None"
) -> Any:
    """The camera's model of how it sees planes [m]."""
    if camera.KIND == "single-lens":
        if samples is not None:
            raise FormatError(f"a {camera.KIND} camera has no lenslets to count --samples by. Leave it out.")
        return camera.operator(planes)
    known: dict[str, Any] = {}
    if calibration is not None and hasattr(camera, "sampling_distances"):
        known["pixels"] = calibration
    return camera.operator(planes, samples, **known)


def vignetting(white: "np.ndarray", pitch: float) -> "np.ndarray":
    """How much light reaches each micro-image (ny, nx), up to 1: a white image smoothed over lenslets.

    The micro-images' own shape is left to the model. `pitch` in pixels.
    """
    import numpy as np
    from scipy.ndimage import gaussian_filter

    smooth = gaussian_filter(np.maximum(white, 0), 1.5 * pitch, mode="nearest")
    top = float(np.percentile(smooth, 99))
    if top <= 0:
        raise FormatError("--white has no light above the dark. Take a picture of an evenly lit surface.")
    return np.clip(smooth / top, 0.0, 1.0)


def _plane(option: str, path: Path, raw: "RawImage") -> "np.ndarray":
    import numpy as np

    from lumigraph.core.arrays import to_numpy

    data = np.asarray(to_numpy(files.read_raw(path).data), np.float64)
    if data.shape != tuple(raw.data.shape):
        raise FormatError(
            f"{option} {path} has shape {data.shape} but the raw image {tuple(raw.data.shape)}."
        )
    return data


def _values(found: Any, steps: "list[Step]", output: Path) -> dict[str, Any]:
    from lumigraph.core.volume import Volume

    values: dict[str, Any] = {"shape": tuple(found.data.shape), "output": str(output)}
    if isinstance(found, Volume):
        values |= {"spacing": found.spacing, "depths": found.depths}
    elif getattr(found, "pixel_pitch", None):
        values["pixel_pitch"] = found.pixel_pitch
    if steps:
        last = steps[-1]
        values |= {"iterations": last.iteration, "deviance": last.deviance, "stopped": last.stopped}
    return values


def _text(values: dict[str, Any]) -> str:
    shape = " x ".join(map(str, values["shape"]))
    text = f"{shape} samples"
    if "spacing" in values:
        text += " of " + " x ".join(f"{1e6 * step:.4g}" for step in values["spacing"]) + " um"
    elif "pixel_pitch" in values:
        text += f" of {1e6 * values['pixel_pitch']:.4g} um"
    if "deviance" in values:
        text += f"\n{values['iterations']} iterations, deviance {values['deviance']:.4g} per pixel"
    else:
        text += "\nthe checkpoint was finished already"
    return text + "".join(f"\nwritten {values[key]}" for key in ("output",))


def _shown(name: str, value: Any) -> str:
    """A number as the report tells it, with its unit."""
    from lumigraph.core.picture import length

    if name in ("depths", "pitch", "object_pitch", "grid_pitch", "spacing"):
        each = value if isinstance(value, list | tuple) else [value]
        return ", ".join(length(float(one)) for one in each)
    return f"{value:.5g}" if isinstance(value, float) else str(value)


def _page(found: Any, raw: "RawImage", steps: "list[Step]") -> Any:
    """Likelihood, pictures, numbers."""
    from lumigraph import plots
    from lumigraph.core.volume import Volume
    from lumigraph.report import Page

    page = Page("Deconvolution", "A raw image, and what was in front of the camera.")
    section = page.section("Result")
    if isinstance(found, Volume) and len(found.depths) > 1:
        section.figure(plots.projections(found), "The brightest sample along each axis.")
        section.figure(plots.slices(found), "Planes through the brightest sample.")
    else:
        section.figure(found.data[0] if isinstance(found, Volume) else found, "Reconstructed picture.")
    section.figure(raw, "Raw image.")
    if len(steps) > 1:
        numbers = [step.iteration for step in steps]
        drawn = plots.curves(
            numbers, {"": [step.deviance for step in steps]}, xlabel="iteration", ylabel="deviance per pixel",
            log=True,
        )  # fmt: skip
        page.section("Convergence").figure(drawn, "Poisson deviance per pixel: less is likelier.")
    return page
