"""Light of several wavelengths: images add up, each in its own colour."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol, Self, TypeVar, runtime_checkable

import numpy as np

from lumigraph.core import arrays, checks
from lumigraph.core.raw import BAYER_PATTERNS, RawImage
from lumigraph.errors import GeometryError
from lumigraph.scene import Scene, Slice, SpectralLine
from lumigraph.sensor import mosaic
from lumigraph.simulation import curves


@dataclass(frozen=True, slots=True)
class Spectrum:
    """Wavelengths, and the response of the sensor's channels to each.

    Thin lenses are free of dispersion: what differs between the wavelengths is diffraction. A main lens of a
    prescription, and lenslets with an Abbe number, have the colours of their glass, focused at the camera's
    own wavelength.

    Parameters
    ----------
    wavelengths
        Wavelengths in vacuum [m].
    weights
        (wavelengths, channels), channels 1 or 3 (red, green, blue), not negative; those of a channel are
        scaled to a sum of 1, so that an even white scene has mean 1 in all of them.
    bayer
        Pattern of a colour filter, such as "RGGB": the raw image is (ny, nx). None keeps (ny, nx, 3).
    error
        Error of the degree of coherence by few wavelengths; raw images count it in their error.

    Raises
    ------
    GeometryError
        No wavelengths, weights of another shape or below 0, an unknown pattern, or one without colours.

    Examples
    --------
    >>> Spectrum.band(500e-9, 600e-9, 3).wavelengths
    (5e-07, 5.5e-07, 6e-07)
    """

    wavelengths: tuple[float, ...]
    weights: tuple[tuple[float, ...], ...]
    bayer: str | None = None
    error: float = 0.0

    def __post_init__(self) -> None:
        wavelengths = tuple(checks.positive("a wavelength", w) for w in self.wavelengths)
        weights = np.array(self.weights, np.float64)
        if not wavelengths or weights.shape not in ((len(wavelengths), 1), (len(wavelengths), 3)):
            raise GeometryError(
                f"weights have shape {weights.shape} but must have a row for each of {len(wavelengths)} "
                "wavelengths and 1 column, or 3 for red, green and blue."
            )
        if not np.isfinite(weights).all() or weights.min() < 0 or weights.sum(0).min() <= 0:
            raise GeometryError("weights must be finite, at least 0, and above 0 somewhere in each channel.")
        if self.bayer is not None:
            checks.choice("bayer", self.bayer, BAYER_PATTERNS)
            if weights.shape[1] != 3:
                raise GeometryError(f"bayer is {self.bayer!r} but the weights have 1 channel. Give three.")
        object.__setattr__(self, "wavelengths", wavelengths)
        object.__setattr__(self, "weights", tuple(map(tuple, (weights / weights.sum(0)).tolist())))

    @classmethod
    def band(cls, shortest: float, longest: float, count: int = 5) -> "Spectrum":
        """One channel with an even response over a band [m], by so many wavelengths."""
        count = checks.whole("count", count)
        return cls(tuple(np.linspace(shortest, longest, count).tolist()), ((1.0,),) * count)

    @classmethod
    def line(cls, line: SpectralLine, path_difference: float, accuracy: float = 1e-3) -> "Spectrum":
        """One channel for a narrow line, for light of a largest path difference [m].

        Its degree of coherence over that way is right to an accuracy.
        """
        checks.instance("line", line, SpectralLine)
        wavelengths, weights, error = line.nodes(path_difference, accuracy)
        return cls(tuple(wavelengths.tolist()), tuple((w,) for w in weights.tolist()), error=error)

    @classmethod
    def curves(
        cls,
        wavelengths: Sequence[float] | np.ndarray,
        responses: Sequence[float] | np.ndarray,
        path_difference: float,
        *,
        light: Sequence[float] | np.ndarray | None = None,
        accuracy: float = 1e-2,
        bayer: str | None = None,
    ) -> "Spectrum":
        """Spectrum of a light, filters and pixels given as curves, linear between their wavelengths.

        Each channel has its own wavelengths, Gauss's nodes of its light: as few as keep its degree of
        coherence to an accuracy over the largest path difference, such as a `camera.path_difference`.

        Parameters
        ----------
        wavelengths
            (n,) of the curves, rising [m].
        responses
            (n,) or (n, 3): how much of the light filters pass and pixels count, in any unit.
        path_difference
            The largest between ways that meet in a point of the image [m].
        light
            (n,) per wavelength, in any unit, such as of a lamp; None for an even one.
        accuracy
            Accuracy of the degree of coherence.
        bayer
            Bayer pattern as of a `Spectrum`.

        Raises
        ------
        GeometryError
            Curves of other lengths, that do not rise, below 0, or dark.
        SamplingError
            More than 40 wavelengths a channel.
        """
        at, values = curves.checked(wavelengths, responses, light)
        channels = [curves.few(at, each, path_difference, accuracy) for each in values.T]
        rows = [
            [w if k == channel else 0.0 for k in range(len(channels))]
            for channel, (_, weights, _) in enumerate(channels)
            for w in weights.tolist()
        ]
        found = np.concatenate([nodes for nodes, _, _ in channels]).tolist()
        return cls(tuple(found), tuple(map(tuple, rows)), bayer, max(off for _, _, off in channels))

    @classmethod
    def load(
        cls, path: str | Path, path_difference: float, *, accuracy: float = 1e-2, bayer: str | None = None
    ) -> "Spectrum":
        """`curves` of a CSV file, whose first line names its columns.

        These are "wavelength [nm]" (or um, m), "response" or "red", "green" and "blue", and, if there is one,
        "light".

        Raises
        ------
        FormatError
            No such file, no table, or other columns.
        GeometryError, SamplingError
            As `curves`.
        """
        wavelengths, responses, light = curves.read(Path(path))
        return cls.curves(
            wavelengths, responses, path_difference, light=light, accuracy=accuracy, bayer=bayer
        )

    @classmethod
    def rgb(
        cls, red: float = 610e-9, green: float = 540e-9, blue: float = 465e-9, bayer: str | None = None
    ) -> "Spectrum":
        """A wavelength [m] for each channel of a colour sensor."""
        return cls((red, green, blue), ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), bayer)

    def lit(self, scene: Scene, number: int) -> Scene:
        """Scene at one wavelength: colours (y, x, 3) weighted by the channels that detect it."""
        parts = []
        for part in scene.parts:
            if isinstance(part, Slice) and part.intensity.ndim == 3:
                part = replace(part, intensity=self._of_wavelength(part.intensity, number))
            parts.append(part)
        return Scene(parts)

    def _of_wavelength(self, colours: Any, number: int) -> Any:
        weights = np.array(self.weights[number])
        if colours.shape[2] != 3 or len(weights) != 3:
            raise GeometryError(
                f"a slice has {colours.shape[2]} colours but the spectrum has {len(weights)} channels. "
                "Give a grey slice (y, x), or 3 of both."
            )
        share = arrays.like(weights / max(weights.sum(), 1e-300), colours)
        return arrays.namespace(colours).sum(colours * share, axis=2)

    def seen(self, images: Sequence[np.ndarray]) -> np.ndarray:
        """Raw image (ny, nx), or (ny, nx, 3), of the images (ny, nx) at all wavelengths."""
        image = np.tensordot(np.array(images), np.array(self.weights, np.float32), axes=(0, 0))
        if image.shape[2] == 1:
            return image[:, :, 0]
        return image if self.bayer is None else mosaic(image, self.bayer)


@runtime_checkable
class Tunable(Protocol):
    """An instrument whose wavelength can be replaced."""

    def at_wavelength(self, wavelength: float) -> Self:
        """The same in light of another wavelength [m]."""
        ...


Instrument = TypeVar("Instrument")


def by_wavelength(
    camera: Instrument, scene: Scene, spectrum: Spectrum, image: Callable[[Instrument, Scene, int], RawImage]
) -> RawImage:
    """Raw image of a scene through ``image(camera, scene, number)`` at each wavelength of a spectrum.

    Raises
    ------
    GeometryError
        A camera that cannot change its wavelength.
    """
    checks.instance("spectrum", spectrum, Spectrum)
    if not isinstance(camera, Tunable):
        raise GeometryError(
            f"camera is of type {type(camera).__name__}, whose wavelength cannot be replaced. "
            "Leave spectrum out, or use a camera such as PlenopticCamera."
        )
    raws = [
        image(camera.at_wavelength(wavelength), spectrum.lit(scene, number), number)
        for number, wavelength in enumerate(spectrum.wavelengths)
    ]
    known = {**raws[0].metadata, "wavelength": spectrum.wavelengths}
    if all("error" in raw.metadata for raw in raws):
        worst = max((raw.metadata["error"] for raw in raws), key=lambda one: one["rms"])
        known["error"] = worst | {"rms": worst["rms"] + spectrum.error}
        if spectrum.error:
            known["error"]["source"] += f"; coherence of {len(raws)} wavelengths to {spectrum.error:.2g}"
    data = spectrum.seen([raw.data for raw in raws])
    return replace(raws[0], data=data, bayer=spectrum.bayer, metadata=known)
