"""A sensor: pixels that count electrons."""

import math
from dataclasses import KW_ONLY, dataclass

import numpy as np

from lumigraph.core import checks
from lumigraph.core.arrays import Array, to_numpy
from lumigraph.core.grid import Grid
from lumigraph.core.raw import RawImage
from lumigraph.errors import GeometryError, LumigraphError
from lumigraph.sensor.angular import AngularResponse

_NOT_NEGATIVE = {
    "read_noise": "electrons", "dark_current": "electrons per second", "exposure_time": "s",
    "black_level": "counts", "prnu": "of the mean", "dsnu": "electrons",
}  # fmt: skip
_RECORDED = (
    "gain", "black_level", "dark_signal", "read_noise", "full_well", "quantum_efficiency", "exposure_time"
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Sensor:
    r"""Square pixels side by side, the pixel (ny // 2, nx // 2) on the axis; EMVA 1288's linear model.

    Photons n release electrons, dark current adds some, and the reading adds noise:

    .. math:: e \sim \mathrm{Poisson}\big(\eta\,(1 + s)\,n + i t\big) + d + \mathcal N(0, \sigma^2),
              \qquad r = \mathrm{round}(b + e / g)

    with the quantum efficiency η, the dark current i over the exposure time t, the read noise σ, the black
    level b, and two fixed patterns, s of the response (PRNU) and d of the dark signal (DSNU). The gain g
    lets a full well read the highest number.

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
        Bits of the numbers read out, 1 to 16.
    quantum_efficiency
        Electrons per photon, above 0 and at most 1.
    dark_current
        Electrons per second without light.
    exposure_time
        Time for which the dark current runs [s]. Light is given for the whole exposure.
    black_level
        Number that no electrons read. Without one the noise of dark pixels is clipped at 0.
    prnu
        Photo response non-uniformity: standard deviation of the pixels' response, of its mean.
    dsnu
        Dark signal non-uniformity: standard deviation of the pixels' dark signal [electrons].
    pattern_seed
        Seed of both fixed patterns: sensors of one seed are the same piece of silicon.
    fill_factor
        Width of a pixel's active square over the pitch: the rest of its area is dark, so that even light of
        1 reads fill_factor², and the pixel's transfer function is sinc(fill_factor · pitch · f).
    angular_response
        Response by the angle of incidence; None where it does not matter.

    Raises
    ------
    GeometryError
        A shape below one pixel, a number out of range, or a black level at or above the highest number.

    References
    ----------
    EMVA Standard 1288, *Characterization of Image Sensors and Cameras*, release 4.0 linear, sections 2 and 3.

    Examples
    --------
    >>> sensor = Sensor((2, 3), 5e-6, bits=8)
    >>> sensor.expose(np.array([[0, 0.6, 1], [1, 0.2, 2]]), reference=1, fill=1).data.tolist()
    [[0, 153, 255], [255, 51, 255]]
    >>> dim = Sensor((1, 2), 5e-6, full_well=1000, bits=8, quantum_efficiency=0.5, black_level=5)
    >>> dim.expose(np.array([[0, 1]]), photons=400).data.tolist()  # 200 electrons of 4 to a number
    [[5, 55]]
    """

    shape: tuple[int, int]
    pixel_pitch: float
    full_well: float = 10000.0
    read_noise: float = 5.0
    bits: int = 12
    _: KW_ONLY
    quantum_efficiency: float = 1.0
    dark_current: float = 0.0
    exposure_time: float = 0.0
    black_level: float = 0.0
    prnu: float = 0.0
    dsnu: float = 0.0
    pattern_seed: int = 0
    fill_factor: float = 1.0
    angular_response: AngularResponse | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "shape", checks.shape("shape", self.shape))
        object.__setattr__(self, "pixel_pitch", checks.positive("pixel_pitch", self.pixel_pitch))
        checks.positive("full_well", self.full_well, "electrons")
        for name, unit in _NOT_NEGATIVE.items():
            if checks.finite(name, getattr(self, name), unit) < 0:
                raise GeometryError(f"{name} is {getattr(self, name):g} {unit} but must be at least 0.")
        for name in ("quantum_efficiency", "fill_factor"):
            if not 0 < (part := checks.finite(name, getattr(self, name), "1")) <= 1:
                raise GeometryError(f"{name} is {part:g} but must be above 0 and at most 1.")
        checks.whole("pattern_seed", self.pattern_seed, 0)
        if isinstance(self.bits, bool) or not isinstance(self.bits, int) or not 1 <= self.bits <= 16:
            raise GeometryError(f"bits is {self.bits!r} but must be a whole number from 1 to 16.")
        if self.black_level >= self.levels:
            raise GeometryError(
                f"black_level is {self.black_level:g} but the highest number of {self.bits} bits is "
                f"{self.levels}. Leave room for light, or raise bits."
            )

    @property
    def grid(self) -> Grid:
        """Centres of the pixels."""
        return Grid(self.shape, (self.pixel_pitch, self.pixel_pitch))

    @property
    def levels(self) -> int:
        """Highest number read out, 2^bits - 1: a full well."""
        return 2**self.bits - 1

    @property
    def gain(self) -> float:
        """Electrons per number read out, full well / (levels - black level)."""
        return self.full_well / (self.levels - self.black_level)

    @property
    def dark_signal(self) -> float:
        """Electrons that the dark current leaves in the exposure time, in the mean."""
        return self.dark_current * self.exposure_time

    @property
    def dark_noise(self) -> float:
        """Standard deviation of a pixel without light, read noise and dark current [electrons]."""
        return math.sqrt(self.read_noise**2 + self.dark_signal)

    def expose(
        self,
        intensity: Array,
        *,
        reference: float | None = None,
        fill: float = 0.9,
        photons: float | None = None,
        rng: np.random.Generator | None = None,
    ) -> RawImage:
        """Raw image of an intensity: photon and read noise, fixed patterns, whole numbers.

        Parameters
        ----------
        intensity
            (y, x) or (y, x, c), not negative, in any unit; any array library.
        reference
            The intensity that fills `fill` of a full well; None takes the brightest pixel.
        fill
            Fraction of a full well, above 0; more than 1 overexposes.
        photons
            Photons that an intensity of 1 sends to a pixel, in the place of `reference` and `fill`.
        rng
            Random numbers; None for an exposure without noise. The fixed patterns always show.

        Returns
        -------
        RawImage
            NumPy, uint8 up to 8 bits, else uint16. The metadata gives what a program needs to go back to
            light: electrons and photons per unit of intensity, gain, black level, dark signal, read noise.

        Raises
        ------
        GeometryError
            A shape that differs from the sensor's; a reference, fill or photons not above zero; photons
            together with a reference.
        LumigraphError
            NaN, infinite or negative intensities.
        """
        checks.array("intensity", intensity)
        if rng is not None:
            checks.instance("rng", rng, np.random.Generator)
        light = np.asarray(to_numpy(intensity), np.float64)
        self._check(light)
        scale = self._electrons_per_intensity(light, reference, fill, photons)
        electrons = self._electrons(light * scale, rng)
        per_electron = (self.levels - self.black_level) / self.full_well
        numbers = np.clip(np.rint(electrons * per_electron + self.black_level), 0, self.levels)
        data = numbers.astype(np.uint8 if self.bits <= 8 else np.uint16)
        known = {"electrons_per_intensity": scale, "photons_per_intensity": scale / self.quantum_efficiency}
        known |= {name: getattr(self, name) for name in _RECORDED}
        return RawImage(data, self.pixel_pitch, self.bits, metadata=known)

    def _electrons_per_intensity(
        self, light: np.ndarray, reference: float | None, fill: float, photons: float | None
    ) -> float:
        if photons is not None:
            if reference is not None:
                raise GeometryError(
                    f"photons {photons:g} and reference {reference:g} both set the scale: give one."
                )
            return checks.positive("photons", photons, "1") * self.quantum_efficiency
        brightest = float(light.max()) if reference is None else checks.positive("reference", reference, "1")
        return checks.positive("fill", fill, "1") * self.full_well / (brightest or 1.0)

    def _electrons(self, expected: np.ndarray, rng: np.random.Generator | None) -> np.ndarray:
        """Electrons read in each pixel of those that light releases in the mean."""
        response, dark = self._patterns(expected.ndim)
        electrons = expected * response + self.dark_signal
        if rng is not None:
            noise = rng.poisson(np.minimum(electrons, 2.0**62))
            electrons = noise + rng.normal(0.0, self.read_noise, electrons.shape)
        return electrons + dark

    def _patterns(self, ndim: int) -> tuple[np.ndarray | float, np.ndarray | float]:
        """Response over its mean, and dark signal less its mean [electrons], of each pixel."""
        if not self.prnu and not self.dsnu:
            return 1.0, 0.0
        drawn = np.random.default_rng(self.pattern_seed).standard_normal((2, *self.shape))
        response, dark = drawn if ndim == 2 else drawn[..., None]
        return np.maximum(1 + self.prnu * response, 0.0), self.dsnu * dark

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
