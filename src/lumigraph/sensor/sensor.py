"""A sensor: pixels that count electrons."""

from dataclasses import dataclass

import numpy as np

from lumigraph.core import checks
from lumigraph.core.arrays import Array, to_numpy
from lumigraph.core.grid import Grid
from lumigraph.core.raw import RawImage
from lumigraph.errors import GeometryError, LumigraphError


@dataclass(frozen=True, slots=True)
class Sensor:
    """Square pixels side by side, the pixel (ny // 2, nx // 2) on the axis.

    Parameters
    ----------
    shape
        Pixels (ny, nx).
    pixel_pitch
        Distance between pixels, and their width [m].
    full_well
        Electrons that a pixel holds.
    read_noise
        Standard deviation of the reading [electrons].
    bits
        Of the numbers read out, 1 to 16.

    Raises
    ------
    GeometryError
        A shape below one pixel, a pitch or full well that is not above zero, a negative read noise, or
        bits outside 1 to 16.

    Examples
    --------
    >>> sensor = Sensor((2, 3), 5e-6, bits=8)
    >>> sensor.expose(np.array([[0, 0.6, 1], [1, 0.2, 2]]), reference=1, fill=1).data.tolist()
    [[0, 153, 255], [255, 51, 255]]
    """

    shape: tuple[int, int]
    pixel_pitch: float
    full_well: float = 10000.0
    read_noise: float = 5.0
    bits: int = 12

    def __post_init__(self) -> None:
        object.__setattr__(self, "shape", checks.shape("shape", self.shape))
        checks.positive("pixel_pitch", self.pixel_pitch)
        checks.positive("full_well", self.full_well, "electrons")
        if checks.finite("read_noise", self.read_noise, "electrons") < 0:
            raise GeometryError(f"read_noise is {self.read_noise:g} electrons but must be at least 0.")
        if isinstance(self.bits, bool) or not isinstance(self.bits, int) or not 1 <= self.bits <= 16:
            raise GeometryError(f"bits is {self.bits!r} but must be a whole number from 1 to 16.")

    @property
    def grid(self) -> Grid:
        """Centres of the pixels."""
        return Grid(self.shape, (self.pixel_pitch, self.pixel_pitch))

    @property
    def levels(self) -> int:
        """Highest number read out, 2^bits - 1: a full well."""
        return 2**self.bits - 1

    def expose(
        self,
        intensity: Array,
        *,
        reference: float | None = None,
        fill: float = 0.9,
        rng: np.random.Generator | None = None,
    ) -> RawImage:
        """What is read out of an intensity: photon noise, read noise, a full well at most, whole numbers.

        Parameters
        ----------
        intensity
            (y, x) or (y, x, c), not negative, in any unit; any array library.
        reference
            The intensity that fills `fill` of a full well; None takes the brightest pixel.
        fill
            Fraction of a full well, above 0; more than 1 overexposes.
        rng
            Random numbers; None for an exposure without noise.

        Returns
        -------
        RawImage
            NumPy, uint8 up to 8 bits, else uint16. Metadata tells the gain [electrons per unit of intensity].

        Raises
        ------
        GeometryError
            A shape that differs from the sensor's, or a reference or fill that is not above zero.
        LumigraphError
            NaN, infinite or negative intensities.
        """
        checks.array("intensity", intensity)
        if rng is not None:
            checks.instance("rng", rng, np.random.Generator)
        light = np.asarray(to_numpy(intensity), np.float64)
        self._check(light)
        brightest = float(light.max()) if reference is None else checks.positive("reference", reference, "1")
        gain = checks.positive("fill", fill, "1") * self.full_well / (brightest or 1.0)
        electrons = light * gain
        if rng is not None:
            electrons = rng.poisson(np.minimum(electrons, 2.0**62)) + rng.normal(
                0.0, self.read_noise, electrons.shape
            )
        numbers = np.clip(np.rint(electrons * (self.levels / self.full_well)), 0, self.levels)
        data = numbers.astype(np.uint8 if self.bits <= 8 else np.uint16)
        known = {"electrons_per_intensity": gain, "full_well": self.full_well, "read_noise": self.read_noise}
        return RawImage(data, self.pixel_pitch, self.bits, metadata=known)

    def _check(self, light: np.ndarray) -> None:
        if light.ndim not in (2, 3) or light.shape[:2] != self.shape:
            raise GeometryError(
                f"intensity has shape {light.shape} but the sensor has {self.shape} pixels: "
                "use integrate(intensity, grid, sensor) first."
            )
        checks.finite_array("intensity", light)
        if (lowest := light.min()) < 0:
            raise LumigraphError(
                f"intensity goes down to {lowest:g} but light is at least 0. "
                "Clip ringing with np.maximum(..., 0)."
            )
