"""Camera files: what is read, what is refused, and in which words."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from lumigraph.errors import FormatError, GeometryError, LumigraphError
from lumigraph.instruments import (
    FocusedPlenopticCamera,
    Lenslets,
    MainLens,
    Pixels,
    PlenopticCamera,
    SingleLensCamera,
    catalogue,
    load_camera,
)

EXAMPLE = """
kind = "focused-plenoptic"
wavelength = "633 nm"
object_distance = "120 mm"
[main_lens]
focal_length = "60 mm"                    # diameter left out: matched to the lenslets
[lenslets]
pitch = "150 um"
focal_length = "5.2 mm"
count = [39, 39]
layout = "square"
magnification = 0.5
[sensor]
pixel_pitch = "1.6667 um"
"""

SINGLE = """
kind = "single-lens"
wavelength = "633 nm"
object_distance = "316 mm"
[main_lens]
focal_length = "158 mm"
diameter = "5 mm"
[sensor]
pixel_pitch = "5 um"
shape = [200, 200]
"""


@pytest.fixture
def write(tmp_path):
    def write(text, name="camera.toml"):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write


def refused(error, message, path):
    """One or two sentences on one line that start with the file's name."""
    with pytest.raises(LumigraphError) as caught:
        load_camera(path)
    assert type(caught.value) is error, caught.value
    assert not isinstance(caught.value, ValidationError)
    assert re.search(message, str(caught.value)), str(caught.value)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)


def test_the_example_loads(write):
    camera = load_camera(write(EXAMPLE))
    assert isinstance(camera, FocusedPlenopticCamera)
    assert camera.pupil_diameter == pytest.approx(2.308e-3, abs=1e-6)
    assert camera.lenslets.focal_length == pytest.approx((5.2e-3,))
    assert camera == FocusedPlenopticCamera.from_toml(write(EXAMPLE))


def test_every_camera_of_the_catalogue_loads_by_its_name():
    names = catalogue()
    assert {"thesis-plenoptic-1", "thesis-plenoptic-2-m050", "thesis-2f", "galilean"} <= set(names)
    for name in names:
        assert name in type(load_camera(name)).__name__ or load_camera(name).describe().rows


def test_a_file_wins_over_a_name_of_the_catalogue(write, monkeypatch):
    path = write(SINGLE, "thesis-plenoptic-1")
    monkeypatch.chdir(path.parent)
    assert isinstance(load_camera("thesis-plenoptic-1"), SingleLensCamera)


def test_a_class_finds_its_kind_in_the_catalogue():
    assert PlenopticCamera.from_catalogue("thesis-plenoptic-1") == load_camera("thesis-plenoptic-1")
    with pytest.raises(FormatError, match="thesis-2f describes a 'single-lens' camera, not a 'plenoptic'"):
        PlenopticCamera.from_catalogue("thesis-2f")


def test_an_unknown_name_tells_the_nearest():
    with pytest.raises(
        FormatError, match=r"'thesis-plenoptic' is neither .* Did you mean 'thesis-plenoptic-1'\?"
    ):
        load_camera("thesis-plenoptic")
    with pytest.raises(
        FormatError, match=r"'xyz' is neither a camera file nor .* The catalogue has galilean"
    ):
        load_camera("xyz")


G, F = GeometryError, FormatError
CHANGES = [  # what to replace in EXAMPLE, by what, which error, in which words
    ("pitch = ", "pitc = ", F, r"lenslets\.pitc is not a known key\. Did you mean 'lenslets\.pitch'"),
    ("wavelength =", "wave_length =", F, r"wave_length is not a known key\. Did you mean 'wavelength'"),
    ("[sensor]", "[detector]", F, r"detector is not a known key\. Known here: wavelength, "),
    ("[sensor]", "[sensor.angular_response]\nangle = 3\n[sensor]", F, r"e\.angle is not .* 'sensor.*angles'"),
    ('pitch = "150 um"', 'pitch = "-150 um"', G, r"lenslets\.pitch: -150 um is not above zero\. Give"),
    ('pitch = "150 um"', 'pitch = "0 um"', G, r"lenslets\.pitch: 0 um is not above zero"),
    ('pitch = "150 um"', "pitch = 150", F, r"lenslets\.pitch: 150 has no unit\. Write .* '150 um'"),
    ('pitch = "150 um"', "pitch = nan", F, r"lenslets\.pitch: nan has no unit"),
    ('pitch = "150 um"', 'pitch = "150 kg"', F, r"lenslets\.pitch: '150 kg' is not a length\. Write"),
    ('pitch = "150 um"', 'pitch = "150 foo"', F, r"lenslets\.pitch: .* unknown unit 'foo'"),
    ('pitch = "150 um"', 'pitch = "1e200 um"', G, r"lenslets\.pitch: 1e200 um is not between 1 nm"),
    ('pitch = "150 um"', 'pitch = "1e999 um"', F, r"lenslets\.pitch: '1e999 um' is not finite"),
    ('pitch = "150 um"', "pitch = true", F, r"lenslets\.pitch: True is not a length"),
    ('pitch = "150 um"', "", F, r"lenslets\.pitch is missing\. Give it a value"),
    ('"633 nm"', '"633 mm"', G, r"wavelength: 633 mm is longer than 1 mm\. Check the unit"),
    ("[39, 39]", "[39]", G, r"lenslets\.count: \[39\] is not two whole numbers\. Write \[ny, nx\]"),
    ("[39, 39]", "[39.0, 39]", G, r"lenslets\.count: \[39\.0, 39\] is not two whole numbers"),
    ("[39, 39]", "[0, 39]", G, r"lenslets\.count: \[0, 39\] has a number below 1"),
    ("[39, 39]", "[39000, 39000]", G, r"lenslets\.count: 39000 x 39000 lenslets are more than"),
    ('"square"', '"squar"', G, r"lenslets\.layout: 'squar' is not 'square' or 'hex'"),
    ("= 0.5", "= 0.0", G, r"lenslets\.magnification is 0 but must be above 0 \(Keplerian\)"),
    ("= 0.5", "= -1", G, r"magnification is -1 but must be above 0 .* between -1 and 0 \(Galilean\)"),
    ("= 0.5", "= 1e-9", G, r"lenslets\.magnification is 1e-09, outside 0\.001 to 1000"),
    ("= 0.5", "= nan", G, r"lenslets\.magnification: nan is not a finite number"),
    ("= 0.5", '= "0.5"', G, r"lenslets\.magnification: '0\.5' is not a finite number"),
    ("magnification = 0.5", "", F, r"lenslets\.magnification is missing\. Give m = b/a"),
    ("= 0.5", "= -0.03", G, r"the lenslets would stand .* mm before the main lens: its image is at"),
    ('"120 mm"', '"50 mm"', G, r"object_distance 50 mm is inside .* focal length of 60 mm.* Move"),
    ('"120 mm"', '"60.001 mm"', G, r"object_distance 60\.001 mm is so close .* Move the object"),
    ("= 0.5", "= 0.5\nfill_factor = 1.5", G, r"fill_factor: 1\.5 is not above 0 and at most 1"),
    ("= 0.5", '= 0.5\nrotation = "700 deg"', G, r"rotation: 700 deg is more than half a turn"),
    ("= 0.5", "= 0.5\nrotation = 2", F, r"rotation: 2 has no unit\. .* '2 deg'"),
    ("= 0.5", '= 0.5\noffset = ["80 um", 0]', G, r"offset along y is 80 µm but must stay below 75 µm"),
    ("= 0.5", '= 0.5\noffset = "80 um"', F, r"lenslets\.offset: '80 um' is not two lengths"),
    ("= 0.5", '= 0.5\noffset = ["1e9 m", 0]', G, r"lenslets\.offset: 1e9 m is beyond 100 km"),
    ("= 0.5", '= 0.5\nshape = "hex"', G, r"shape 'hex' does not tile layout 'square'\. Use 'square'"),
    ('"5.2 mm"', '["1 mm", "2 mm"]', G, r"focal_length: .* is not one length or three"),
    ('"5.2 mm"', '["1 mm", "2 mm", "3 mm"]', G, r"three focal lengths need layout 'hex', .* not 'square'"),
    ("[sensor]", "[sensor]\nbits = 40", G, r"sensor\.bits: 40 is not a whole number from 1 to 16"),
    ("[sensor]", "[sensor]\nfull_well = 0", G, r"sensor\.full_well: 0 is not above zero"),
    ("[sensor]", "[sensor]\nread_noise = -1", G, r"sensor\.read_noise: -1 is below zero"),
    ("[sensor]", "[sensor]\nquantum_efficiency = 2", G, r"efficiency: 2 is not above 0 and at most 1"),
    ("[sensor]", "[sensor]\nexposure_time = 0.01", F, r"exposure_time: 0\.01 has no unit\. .* '10 ms'"),
    ("[sensor]", '[sensor]\nexposure_time = "10 mm"', F, r"exposure_time: '10 mm' is not a time"),
    ("[sensor]", "[sensor]\nblack_level = 5000", G, r"sensor: black_level is 5000 but the highest"),
    ("[sensor]", "[sensor]\npattern_seed = -1", G, r"pattern_seed: -1 is not a whole number of at least 0"),
    ("[sensor]", "[sensor]\nshape = [40000, 40000]", G, r"sensor\.shape: 40000 x 40000 = 1\.6e\+09 pixels"),
    ("[main_lens]", "[main_lens]\naberrations = 3", F, r"main_lens\.aberrations: 3 is not a table"),
    ("[main_lens]", "[main_lens]\naberrations = {x = 1}", F, r"aberrations: 'x' is not a Noll index"),
    ("[main_lens]", "[main_lens]\naberrations = {4 = 1e9}", G, r"Noll term 4 has .* at most 1000"),
    ("[main_lens]\nfocal_length", "main_lens = 3\n[x]\nfocal_length", F, r"x is not a known key"),
    ('"focused-plenoptic"', '"pinhole"', F, r"kind 'pinhole' is not one of 'single-lens', 'plenoptic'"),
    ('"focused-plenoptic"', "[3]", F, r"kind \[3\] is not one of"),
    ('kind = "focused-plenoptic"', "", F, r"has no kind\. Add a first line such as kind = 'plenoptic'"),
    ('"focused-plenoptic"', '"plenoptic"', G, r"lenslets\.magnification is 0\.5, but .* Leave it out"),
    ("[39, 39]", "[39, 39", F, r"is damaged TOML: .* Correct that line"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "error", "message"), CHANGES, ids=lambda value: str(value)[:24])
def test_each_mistake_gives_one_line_that_names_it(write, old, new, error, message):
    assert old in EXAMPLE
    refused(error, message, write(EXAMPLE.replace(old, new, 1)))


@pytest.mark.parametrize(
    ("old", "new", "error", "message"),
    [
        ('diameter = "5 mm"', "", FormatError, r"main_lens\.diameter is missing\. A camera without lenslets"),
        ("shape = [200, 200]", "", FormatError, r"sensor\.shape is missing\. A camera without lenslets"),
        ("[sensor]", "[lenslets]\npitch = 3\n[sensor]", FormatError, r"lenslets is not a known key"),
        ("[main_lens]", "matching = 'views'\n[main_lens]", FormatError, r"matching is not a known key"),
    ],
)
def test_mistakes_about_cameras_without_lenslets(write, old, new, error, message):
    refused(error, message, write(SINGLE.replace(old, new, 1)))


def test_a_multi_focus_array_does_not_fit_a_plenoptic_camera_1(write):
    text = EXAMPLE.replace('"5.2 mm"', '["5 mm", "6 mm", "7 mm"]').replace("magnification = 0.5", "")
    text = text.replace("focused-plenoptic", "plenoptic").replace('"square"', '"hex"')
    refused(GeometryError, r"lenslets\.focal_length has 3 lengths, but .* Give one", write(text))


def test_matching_is_one_of_three(write):
    text = EXAMPLE.replace("[main_lens]", "matching = 'half'\n[main_lens]")
    refused(GeometryError, r"matching: 'half' is not 'views', 'full' or 'touching'", write(text))


def test_files_that_are_no_camera_files(write, tmp_path):
    refused(FormatError, "there is no camera file .* Check", tmp_path / "none.toml")
    refused(FormatError, "is not a file", tmp_path)
    refused(FormatError, "is not text", write(b"\xff\xfe\x00binary"))
    refused(FormatError, "is larger than 1 MiB", write(b"# " + b"x" * 2**20))
    refused(FormatError, "has no kind", write(""))
    refused(FormatError, "damaged TOML", write("a = " + "[" * 5000))


def test_a_class_refuses_another_kind_by_name(write):
    with pytest.raises(
        FormatError, match=r"describes a 'focused-plenoptic' camera, not a 'plenoptic'\. Use .*load_camera"
    ):
        PlenopticCamera.from_toml(write(EXAMPLE))


def test_python_takes_floats_and_text(write):
    camera = FocusedPlenopticCamera(
        wavelength=633e-9,
        object_distance="120 mm",
        main_lens=MainLens(focal_length=0.06),
        lenslets=Lenslets(pitch="150 um", focal_length=5.2e-3, count=(39, 39), magnification=0.5),
        sensor=Pixels(pixel_pitch=1.6667e-6),
    )
    assert camera.pupil_diameter == pytest.approx(load_camera(write(EXAMPLE)).pupil_diameter, rel=1e-12)


def plenoptic(**changes):
    lenslets = {"pitch": 1e-4, "focal_length": 4e-3, "count": (5, 5)}
    values = {"main_lens": {"focal_length": 0.1}, "lenslets": lenslets, "sensor": {"pixel_pitch": 5e-6}}
    return PlenopticCamera(wavelength=5e-7, object_distance=1, **{**values, **changes})


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: MainLens(focal_length=float("nan")), GeometryError, r"focal_length: nan m is not finite"),
        (lambda: MainLens(focal_length=-1), GeometryError, r"focal_length: -1 m is not above zero"),
        (
            lambda: MainLens(focal=1.0),
            FormatError,
            r"focal is not a known key\. Did you mean 'focal_length'\?",
        ),
        (lambda: MainLens(), FormatError, r"focal_length is missing"),
        (
            lambda: Pixels(pixel_pitch=5e-6, shape=(1e9, 1)),
            GeometryError,
            r"shape: .* is not two whole numbers",
        ),
        (lambda: plenoptic(lenslets={}), FormatError, r"lenslets\.pitch is missing"),
        (lambda: plenoptic(main_lens=3), FormatError, r"main_lens: 3 is not a table of keys and values"),
        (lambda: plenoptic(main_lens=Pixels(pixel_pitch=1.0)), FormatError, r"main_lens: .* is not a table"),
    ],
)
def test_python_mistakes_are_ours_too(make, error, message):
    with pytest.raises(error, match=message) as caught:
        make()
    assert not isinstance(caught.value, ValidationError)


def test_a_computed_sensor_that_is_too_large_is_refused():
    camera = load_camera("thesis-plenoptic-1").replace(sensor={"pixel_pitch": "50 nm"})
    with pytest.raises(
        GeometryError, match=r"pixels are more than the 2\.68e\+08 that can be simulated\. Check"
    ):
        camera.sensor


@pytest.mark.parametrize("name", catalogue())
def test_the_catalogue_survives_a_round_trip_through_toml(name, write):
    camera = load_camera(name)
    assert load_camera(write(camera.to_toml())) == camera


lengths = st.floats(1e-6, 1e-2)


@given(
    pitch=lengths,
    focal=st.one_of(lengths, st.tuples(lengths, lengths, lengths)),
    rotation=st.floats(-3, 3),
    fill=st.floats(0.01, 1.0),
    waves=st.dictionaries(st.integers(1, 30), st.floats(-10, 10), max_size=3),
)
def test_any_camera_survives_a_round_trip_through_toml(tmp_path_factory, pitch, focal, rotation, fill, waves):
    camera = FocusedPlenopticCamera(
        wavelength="500 nm",
        object_distance=0.3,
        main_lens={"focal_length": 0.1, "aberrations": waves},
        lenslets={
            "pitch": pitch,
            "focal_length": focal,
            "count": (5, 4),
            "layout": "hex",
            "magnification": 0.4,
            "rotation": rotation,
            "fill_factor": fill,
            "offset": (pitch / 9, -pitch / 9),
        },
        sensor={
            "pixel_pitch": pitch / 7.3,
            "bits": 8,
            "full_well": 1234.5,
            "black_level": 8.0,
            "exposure_time": 0.0125,
        },
    )
    path = tmp_path_factory.mktemp("round") / "camera.toml"
    path.write_text(camera.to_toml(), encoding="utf-8")
    assert load_camera(path) == camera
