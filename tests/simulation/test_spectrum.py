"""Light of several wavelengths: colours, Bayer filters, and the operator of a band."""

from dataclasses import replace

import numpy as np
import pytest

import cameras
from lumigraph.errors import GeometryError
from lumigraph.scene import Scene, Slice, SpectralLine
from lumigraph.simulation import Incoherent, Spectrum, simulate
from lumigraph.units import nm, um

ROUGH = Incoherent(accuracy=1e-2)


@pytest.fixture(scope="module")
def camera():
    return cameras.focused(count=(3, 3), pixel_pitch=8 * um)


def picture(camera, channels):
    shape = (*camera.object_grid.shape, channels)
    data = np.zeros(shape, np.float32)
    data[shape[0] // 2 :, :, 0] = 1
    data[:, shape[1] // 2 :, -1] = 0.5
    return Scene([Slice(data if channels > 1 else data[..., 0], camera.object_grid)])


def test_each_colour_is_the_image_at_its_own_wavelength(camera):
    scene, spectrum = picture(camera, 3), Spectrum.rgb(620 * nm, 540 * nm, 460 * nm)
    raw = simulate(camera, scene, ROUGH, spectrum=spectrum)
    assert raw.data.shape == (*camera.sensor.shape, 3)
    assert raw.metadata["wavelength"] == (620 * nm, 540 * nm, 460 * nm)
    for k, wavelength in enumerate(spectrum.wavelengths):
        part = Slice(scene.parts[0].intensity[..., k], camera.object_grid)
        alone = simulate(camera.replace(wavelength=wavelength), Scene([part]), ROUGH)
        np.testing.assert_array_equal(raw.data[..., k], alone.data)


def test_a_lines_error_is_counted_and_told(camera):
    """Of 10 nm over 30 um, by wavelengths that leave 1e-3."""
    line = Spectrum.line(SpectralLine(550 * nm, 10 * nm), 30 * um)
    known = simulate(camera, picture(camera, 1), ROUGH, spectrum=line).metadata["error"]
    alike = simulate(camera, picture(camera, 1), ROUGH, spectrum=replace(line, error=0.0)).metadata["error"]
    assert 1e-5 < line.error <= 1e-3
    assert known["rms"] == pytest.approx(alike["rms"] + line.error)
    assert (
        known["source"]
        == f"{alike['source']}; {len(line.wavelengths)} wavelengths of a line to {line.error:.2g}"
    )


def test_a_bayer_filter_shows_one_colour_to_each_pixel(camera):
    scene = picture(camera, 3)
    colours = simulate(camera, scene, ROUGH, spectrum=Spectrum.rgb()).data
    raw = simulate(camera, scene, ROUGH, spectrum=Spectrum.rgb(bayer="GRBG"))
    assert raw.bayer == "GRBG"
    np.testing.assert_array_equal(raw.data[::2, 1::2], colours[::2, 1::2, 0])
    np.testing.assert_array_equal(raw.data[1::2, ::2], colours[1::2, ::2, 2])


def test_a_band_is_the_mean_of_its_wavelengths_and_so_is_its_operator(camera):
    band = Spectrum.band(600 * nm, 660 * nm, 2)
    operator = camera.operator(spectrum=band, accuracy=1e-2, samples_per_lenslet=4)
    x = np.random.default_rng(0).random(operator.shape[1]).astype(np.float32)
    y = np.random.default_rng(1).random(operator.shape[0]).astype(np.float32)
    single = [
        camera.replace(wavelength=w).operator(accuracy=1e-2, samples_per_lenslet=4).forward(x)
        for w in (600 * nm, 660 * nm)
    ]
    image = operator.forward(x)
    np.testing.assert_allclose(image, (single[0] + single[1]) / 2, rtol=1e-5)
    assert (image.astype(float) * y).sum() == pytest.approx(
        (x * operator.adjoint(y).astype(float)).sum(), rel=1e-6
    )
    scene = Scene([Slice(x, operator.object_grid)])
    np.testing.assert_allclose(simulate(camera, scene, ROUGH, spectrum=band).data, image, atol=1e-4)
    assert operator.psf((2, 3)).sum() > 0


def test_progress_counts_over_all_wavelengths(camera):
    seen = []
    simulate(camera, picture(camera, 3), ROUGH, spectrum=Spectrum.rgb(), progress=seen.append)
    assert {1 / 3, 2 / 3, 1} <= set(seen)
    assert seen == sorted(seen)


def test_what_a_spectrum_cannot_be(camera):
    with pytest.raises(GeometryError, match=r"weights have shape \(2, 1\) but must have a row for each of 1"):
        Spectrum((500 * nm,), ((1.0,), (1.0,)))
    with pytest.raises(GeometryError, match="at least 0, and above 0 somewhere in each channel"):
        Spectrum((500 * nm,), ((0.0,),))
    with pytest.raises(GeometryError, match="'RGGB' but the weights have 1 channel"):
        Spectrum((500 * nm,), ((1.0,),), "RGGB")
    with pytest.raises(GeometryError, match="a slice has 3 colours but the spectrum has 1 channels"):
        simulate(camera, picture(camera, 3), ROUGH, spectrum=Spectrum.band(500 * nm, 600 * nm, 1))
    with pytest.raises(GeometryError, match="whose wavelength cannot be replaced"):
        simulate(object(), picture(camera, 3), ROUGH, spectrum=Spectrum.rgb())
    with pytest.raises(GeometryError, match="the operator has one channel but the spectrum has three"):
        camera.operator(spectrum=Spectrum.rgb())
    with pytest.raises(GeometryError, match=r"Give spectrum=Spectrum.rgb\(\) for a coloured scene"):
        simulate(camera, picture(camera, 3), ROUGH)
