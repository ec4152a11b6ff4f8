"""`lumigraph deconvolve --adaptive`: what it is told, and what it reports."""

import json
from dataclasses import replace

import numpy as np
import pytest
import tifffile
from tests.cli.test_deconvolve_cli import LENS, SCOPE

import lumigraph as lg
from lumigraph.cli.adaptive import Adaptive, with_wavefront
from lumigraph.core.result import Result
from lumigraph.studies.adaptive import Wavefront


@pytest.fixture
def wavefront(tmp_path):
    (tmp_path / "scope.toml").write_text(SCOPE)
    scope = lg.LightFieldMicroscope.from_toml(tmp_path / "scope.toml")
    none = lg.Points(np.zeros((0, 3)), np.zeros(0))
    return Wavefront(
        (6, 8), np.array([[[0.3, -0.4]]]), np.array([[[0.01, 0.02]]]), (np.zeros(1), np.zeros(1)),
        {4: "the volume's depth explains it"}, none, (2.0, 1.0), 1.0, 1, 3, scope, np.diag([1e-4, 4e-4]),
        None, {6: 0.5, 8: 0.25},
    )  # fmt: skip


def test_terms_are_reported_with_their_deviations(wavefront):
    found = with_wavefront(Result("Deconvolution", "", headline=("5 iterations",)), wavefront)
    assert found.headline == (
        "wavefront of 0.500 waves rms: Z6 +0.300 ± 0.010, Z8 -0.400 ± 0.020",
        "Z4 is not known: the volume's depth explains it",
        "5 iterations",
    )
    told = json.loads(json.dumps(found.values()))
    assert told["wavefront"]["rms_waves"] == pytest.approx(0.5)
    assert told["wavefront"]["terms"]["8"] == {"waves": -0.4, "deviation": 0.02, "explained": 0.25}
    assert told["Z6_interval"] == pytest.approx([0.29, 0.31])


def test_the_width_of_beads_is_told_where_they_are_balls(wavefront):
    wide = replace(wavefront, bead_width=2.3e-6, bead_width_deviation=0.1e-6)
    found = with_wavefront(Result("Deconvolution", ""), wide)
    assert found.headline[-1] == "beads are 2.3 µm (2.2 µm to 2.4 µm) wide"
    assert found.values()["bead_width"] == 2.3e-6
    assert "bead_width" not in with_wavefront(Result("Deconvolution", ""), wavefront).values()


def test_the_report_has_a_map_of_the_wavefront(wavefront):
    figure = next(iter(with_wavefront(Result("Deconvolution", ""), wavefront).figures()))
    assert figure.section == "Wavefront"
    drawn = figure.image.axes[0].images[0].get_array()
    assert np.nanmax(drawn) == pytest.approx(np.nanmax(wavefront.phase()))


@pytest.mark.long
def test_beads_are_deconvolved_with_their_aberration(lumigraph, tmp_path):
    (tmp_path / "scope.toml").write_text(SCOPE)
    scope = lg.LightFieldMicroscope.from_toml(tmp_path / "scope.toml")
    bent = scope.replace(objective={"aberrations": {6: 0.2}})
    light = 3000 * bent.point_image(3e-6, -4e-6, 8e-6, accuracy=3e-2)
    raw = np.random.default_rng(0).poisson(light + 1).astype(np.float32)
    tifffile.imwrite(tmp_path / "raw.tif", raw)
    depths = ("--depth", "0 um:16 um:4 um")
    given = ("deconvolve", "raw.tif", "--camera", "scope.toml", "--background", "1", *depths)
    done = ("--iterations", "3", "--samples", "3", "--json", "--report", "page.html", "-o", "volume.h5")
    found = lumigraph(*given, "--adaptive", "--terms", "6", "--object", "beads", *done)
    assert found.code == 0, found.err
    told = json.loads(found.out)
    assert told["wavefront"]["terms"]["6"]["waves"] == pytest.approx(0.2, abs=0.02)
    assert "Wavefront" in (tmp_path / "page.html").read_text()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--terms 5-11", "Add --adaptive"),
        ("--object beads", "Add --adaptive"),
        ("--adaptive --terms 11-5", "Noll indices from 1 to 66"),
        ("--adaptive --terms 0", "Noll indices from 1 to 66"),
        ("--adaptive --terms coma", "Noll indices from 1 to 66"),
        ("--adaptive", "configuration '1.0'"),
    ],
)
def test_what_is_not_to_be_found_is_refused_in_a_line(lumigraph, tmp_path, words, message):
    (tmp_path / "lens.toml").write_text(LENS)
    tifffile.imwrite(tmp_path / "raw.tif", np.ones((40, 50), np.float32))
    found = lumigraph("deconvolve", "raw.tif", "--camera", "lens.toml", *words.split(), "-o", "picture.tiff")
    assert found.code != 0
    assert message in found.err


def test_several_files_have_no_one_wavefront():
    with pytest.raises(lg.FormatError, match="takes one raw image, but there are 2 files"):
        Adaptive(adaptive=True).check(2)
