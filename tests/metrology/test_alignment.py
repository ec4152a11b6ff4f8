"""Benches that align themselves, by devices of UniMMCore."""

import json
import subprocess
import sys
from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.errors import CalibrationError, FormatError
from lumigraph.metrology.alignment.belief import Belief
from lumigraph.metrology.alignment.moves import BenchError, next_moves, route
from lumigraph.metrology.alignment.rays import BenchRays
from lumigraph.metrology.alignment.reading import WhiteReader, WhiteReading
from lumigraph.metrology.alignment.setup import STATES, Motor, read_setup, setup_of
from lumigraph.metrology.alignment.simulated import SimulatedBench, simulated
from lumigraph.metrology.twin import BenchModel

pytest.importorskip("pymmcore_plus", reason="pymmcore-plus is not installed")

LENGTH = {"step": "0.1 um", "backlash": "20 um", "limits": ["-1 mm", "1 mm"]}
ANGLE = {
    "unit": "0.001 deg", "step": "0.001 deg", "backlash": "0.05 deg", "limits": ["-3 deg", "3 deg"],
}  # fmt: skip
STOP = {"unit": "0.01 %", "step": "0.01 %", "backlash": "0.2 %", "limits": ["-20 %", "20 %"]}
MOTORS = (
    {"moves": "height", "device": "ArrayZ", **LENGTH},
    {"moves": "shift_y", "device": "ArrayXY", "coordinate": "y", **LENGTH},
    {"moves": "shift_x", "device": "ArrayXY", "coordinate": "x", **LENGTH},
    {"moves": "tilt_y", "device": "TiltY", **ANGLE},
    {"moves": "tilt_x", "device": "TiltX", **ANGLE},
    {"moves": "turn", "device": "Rotation", **ANGLE},
    {"moves": "aperture", "device": "Stop", "property": "Diameter", **STOP},
)
GOAL = lg.metrology.AlignmentGoal(pitch_error=5e-6)


@pytest.fixture(scope="module")
def camera():
    return lg.PlenopticCamera(
        wavelength=550e-9, object_distance="240 mm",
        main_lens={"focal_length": "120 mm", "diameter": "3.2 mm"},
        lenslets={"pitch": "150 um", "focal_length": "10 mm", "count": (17, 17)},
        sensor={"pixel_pitch": "8 um", "black_level": 64},
    )  # fmt: skip


START = np.array([19.53, 0, 0, 19.53, 0, 0, 0, 0, 16.4])
NOISE = np.array([*4 * [2e-5], *2 * [3e-4], *2 * [5e-4], 1e-3])


class ByRays(WhiteReader):
    """A reader that is given what a bench would show, so that loops take no images."""

    def shows(self, made):
        object.__setattr__(self, "made", made)
        return self

    rays = BenchRays((0.24, 0.01, 8e-6), START, 390.0, (0.9, -0.2))

    def read(self, image, top=None):
        truth = np.array([self.made.truth()[one] for one in STATES])
        values = self.rays.measures(truth) + NOISE * self.made.rng.standard_normal(9)
        return WhiteReading(values, NOISE, 390.0, (0, 0), np.zeros((4, 2)), float(np.mean(image)))

    def matched(self, image, reading, state):
        return reading


class Dim(SimulatedBench):
    """A bench whose pictures show nothing: `ByRays` does not look at them."""

    def light(self, truth):
        return np.ones((8, 8))


def bench(camera, seed=1, motors=MOTORS, **options):
    setup = setup_of({"motor": list(motors), "drift": "5 um", "simulated": {"seed": seed, **options}})
    made = simulated(setup, camera.replace(sensor={"shape": (8, 8)}))
    names = ("camera", "state", "motors", "rng", "noise", "fading", "drift", "vibration", "frozen")
    made = Dim(**{name: getattr(made, name) for name in names})
    from lumigraph.metrology.alignment.unicore import simulated_devices

    return simulated_devices(setup, made), made, ByRays(camera).shows(made)


def left(made):
    """What is out of place over its tolerance, at most."""
    units = {"height": 5e-6, "shift_y": 5e-6, "shift_x": 5e-6, "aperture": 1e-3}
    return max(
        abs(made.truth()[one.motor.moves]) / units.get(one.motor.moves, 3.49e-4) for one in made.motors
    )


def test_white_images_are_what_rays_through_the_stop_say_up_to_whole_lenslets(camera):
    """Waves on one side, three lines of geometry on the other; 1.6 and -1.3 pitches of shift."""
    reader = WhiteReader(camera)
    made = SimulatedBench(camera, {}, (), np.random.default_rng(0))
    state = dict.fromkeys(STATES, 0.0)
    state |= {"height": 1e-4, "tilt_y": 0.012, "tilt_x": -0.01, "turn": 0.015, "aperture": 0.02}
    state |= {"shift_y": 240e-6, "shift_x": -195e-6, "sensor": 5e-5}
    light = made.light(state)
    noise = 0.005 * np.random.default_rng(1).standard_normal(light.shape)
    reading = reader.read(1000 * (light / light.max() + noise) + 64)
    off = np.abs(reading.values - reader.rays.measures(np.array([state[one] for one in STATES])))
    assert off[:4].max() < 2e-3  # px; the shift alone is 30 px, the height 8e-3 px of each vector
    assert off[4:6].max() < 5e-3
    assert off[6:8].max() < 5e-3
    assert off[8] < 0.3  # an array beside its picture has few whole micro-images to measure the width


def test_light_of_a_bench_is_the_operator_s_where_nothing_is_out_of_place(camera):
    made = SimulatedBench(camera, {}, (), np.random.default_rng(0))
    light, meant = made.light(made.truth()), BenchModel(camera).white(np.zeros(7))
    assert np.abs(light - meant).max() < 2e-3 * meant.max()


@pytest.mark.parametrize("seed", range(6))
def test_benches_are_aligned_in_four_exposures_within_their_covariance(camera, seed):
    devices, made, reader = bench(camera, seed)
    steps = list(lg.metrology.align(devices, reader, goal=GOAL))
    assert steps[-1].status == "aligned"
    assert sum(one.status != "learning" for one in steps) <= 4
    assert left(made) <= 1
    belief, truth = steps[-1].belief, made.truth()
    score = [(belief[m.moves] - truth[m.moves]) / belief.error(m.moves) for m in belief.motors]
    assert np.abs(score).max() < 3.5
    play = np.array([belief.backlash(k) for k in range(7)])
    true = np.array([one.backlash for one in made.motors])
    assert (np.abs(play[:, 0] - true) < 3.5 * play[:, 1]).all()


def test_backlash_is_told_by_moves_from_two_sides_and_from_one_side_costs_nothing():
    motor = Motor("shift_x", "X", sign=1, step=1e-7, backlash=20e-6, limits=(-1e-3, 1e-3))
    setup = setup_of({"motor": [MOTORS[0]], "simulated": {}})
    before = Belief.before(replace(setup, motors=(motor,))).moved(0, 0.0, 1).seen(ByRays.rays, _shown())
    same, other = before.moved(0, 1e-4, 1), before.moved(0, 1e-4, -1)
    assert same.error("shift_x") < 0.3e-6
    assert other.error("shift_x") == pytest.approx(20e-6 / np.sqrt(12), rel=0.02)
    assert other["shift_x"] - same["shift_x"] == pytest.approx(10e-6, rel=1e-4)
    assert same.seen(ByRays.rays, _shown(shift_x=1e-4)).backlash(0)[1] > 5e-6
    after = other.seen(ByRays.rays, _shown(shift_x=1e-4 + 13e-6))
    assert after.backlash(0)[0] == pytest.approx(13e-6, abs=0.5e-6)
    assert after.backlash(0)[1] < 0.5e-6


def _shown(**state):
    values = ByRays.rays.measures(np.array([state.get(one, 0.0) for one in STATES]))
    return WhiteReading(values, NOISE, 390.0, (0, 0), np.zeros((4, 2)), 1.0)


def test_an_unknown_pitch_is_told_and_height_is_not_claimed(camera):
    devices, _, reader = bench(camera)
    (*_, last) = lg.metrology.align(devices, reader)
    assert last.status == "aligned"
    assert any("height is known to ±" in one and "white images tell no more" in one for one in last.notes)
    assert last.belief.error("height") > 15e-6


def test_routes_come_from_the_side_they_should_and_stay_within_limits():
    motor = Motor("height", "Z", sign=1, step=1e-6, backlash=20e-6, limits=(-1e-4, 1e-4))
    assert route(motor, (0, 0.0, 1), 5e-6, 1).via is None
    assert route(motor, (0, 0.0, 1), -5e-6, 1).via == pytest.approx(-29e-6)
    assert route(motor, (0, 0.0, 1), -50e-6, -1).via is None
    assert route(motor, (0, 0.0, 1), -95e-6, 1) is None  # it would have to go back beyond its limit
    assert route(motor, (0, 0.0, 1), 2e-4, 1) is None


def test_a_dry_run_moves_nothing_and_says_what_it_would_do(camera):
    signs = {one["moves"]: 1 for one in MOTORS}
    devices, made, reader = bench(camera, motors=[{**one, "sign": 1} for one in MOTORS], signs=signs)
    (step,) = lg.metrology.align(devices, reader, goal=GOAL, dry_run=True)
    assert all(one.position == 0 for one in made.motors)
    assert any("ArrayZ (height) from +0.0 µm" in one for one in step.instructions())


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"stuck": "tilt_y"}, r"TiltY \(tilt_y\) was moved by .* the stage does not move"),
        ({"frozen": 2}, "Camera gives the same picture twice.*frozen"),
        ({"out": {"height": "1.2 mm"}}, r"ArrayZ \(height\) would have to go to .* by hand by"),
    ],
)
def test_what_is_wrong_with_a_bench_is_one_line_that_names_it(camera, options, message, tmp_path):
    devices, made, reader = bench(camera, **options)
    with pytest.raises(BenchError, match=message) as told:
        list(lg.metrology.align(devices, reader, goal=GOAL, log=tmp_path))
    assert "the bench" in str(told.value)
    assert "\n" not in str(told.value)
    assert json.loads((tmp_path / "stopped.json").read_text())["note"]["positions"]
    assert all(abs(one.position) <= one.motor.limits[1] for one in made.motors)


def test_an_inverted_axis_is_told_and_the_bench_goes_back(camera):
    signs = {one["moves"]: 1 for one in MOTORS} | {"turn": -1}
    devices, made, reader = bench(camera, motors=[{**one, "sign": 1} for one in MOTORS], signs=signs)
    with pytest.raises(
        BenchError, match=r"Rotation \(turn\) is inverted.*Set sign = -1.*back to its best place"
    ):
        list(lg.metrology.align(devices, reader, goal=GOAL))
    assert all(abs(one.position) < 2 * one.motor.step for one in made.motors)


def test_moves_that_made_things_worse_twice_end_where_it_was_best(camera):
    """Somebody knocks at the bench, more each time, and too little for one motor to be blamed."""
    options = {"out": {"shift_x": "8 um"}, "signs": {"shift_x": 1}}
    devices, made, reader = bench(camera, motors=[{**MOTORS[2], "sign": 1}], **options)

    class Knocked:
        rng = made.rng

        def truth(self):
            truth = made.truth()
            return truth | {"shift_x": truth["shift_x"] + 1e-6 * (0, 0, 11, 30)[made.exposures]}

    with pytest.raises(BenchError, match=r"made things worse twice.*brought back to its best place"):
        list(lg.metrology.align(devices, reader.shows(Knocked()), goal=GOAL))


def test_lost_light_stops_and_says_so(camera):
    devices, made, reader = bench(camera)
    steps = lg.metrology.align(devices, reader, goal=GOAL)
    next(steps)
    type(made).light = lambda self, truth: np.eye(8)
    try:
        with pytest.raises(BenchError, match=r"the light is lost.*Check lamp and shutter"):
            next(steps)
    finally:
        type(made).light = lambda self, truth: np.ones((8, 8))


def test_devices_refuse_what_they_do_not_have_and_limits(camera):
    devices, made, _ = bench(camera)
    with pytest.raises(BenchError, match=r"no device 'Z9': Micro-Manager has Camera, ArrayZ"):
        lg.metrology.Bench(devices.core, replace(devices.setup, motors=(Motor("height", "Z9"),)))
    with pytest.raises(BenchError, match=r"beyond its limits -1000.0 µm and .1000.0 µm: it was not moved"):
        devices.go(devices.setup.motors[0], 2e-3)
    assert made.motors[0].position == 0
    with pytest.raises(Exception, match="limit switch"):
        made.motors[0].go(2e-3)


def test_a_picture_that_is_too_bright_or_of_another_size_is_refused(camera):
    reader = WhiteReader(camera)
    with pytest.raises(CalibrationError, match=r"saturated .at 255.. Shorten the exposure"):
        reader.read(np.full(camera.sensor.shape, 255), 255)
    with pytest.raises(CalibrationError, match="has 5 x 5 pixels but the camera file 333 x 333"):
        reader.read(np.ones((5, 5)))


def test_an_alignment_that_was_killed_between_its_moves_goes_on(camera, tmp_path):
    devices, made, reader = bench(camera, seed=4)
    steps = lg.metrology.align(devices, reader, goal=GOAL, log=tmp_path)
    signs, step = next(steps), next(steps)
    assert (signs.status, step.status) == ("learning", "moving")
    devices.go(step.belief.motors[0], step.moves[0].stops[0])  # and then the computer is switched off
    again = list(lg.metrology.align(devices, reader, goal=GOAL, log=tmp_path))
    assert [again[0].number, again[-1].status] == [2, "aligned"]
    assert left(made) <= 1
    log = lg.metrology.AlignmentLog(tmp_path)
    assert log.count() == again[-1].number + 1
    assert log.image(0).shape == (8, 8)
    with pytest.raises(FormatError, match="log of another bench"):
        list(lg.metrology.align(bench(camera, motors=MOTORS[:3])[0], reader, log=tmp_path))


def test_a_drifting_bench_is_kept_and_its_drift_measured(camera):
    """5 µm and 0.01° an hour, ten exposures an hour: within twice the tolerances."""
    drift = {"height": "5 um", "shift_x": "-5 um", "turn": "0.01 deg"}
    devices, made, reader = bench(camera, drift=drift)
    steps, worst = [], 0.0
    for step in lg.metrology.watch(devices, reader, seconds=7200, every=360, goal=GOAL):
        steps.append(step.values())
        worst = max(worst, left(made)) if any(one["status"] == "aligned" for one in steps) else 0.0
    assert worst < 2
    rates = lg.metrology.drift_rates(steps)
    for name, true in (("height", 5e-6), ("shift_x", -5e-6), ("turn", 1.745e-4), ("shift_y", 0.0)):
        rate, error = rates[name]
        assert abs(rate - true) < max(4 * error, 0.05 * abs(true))
    assert lg.metrology.drift_table(steps)[1][0] == "height"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("motor = 3\nsimulated = {}", "motor of the bench file is 3 but must be a list of tables"),
        ("[[motor]]\nmoves = 'depth'\n[simulated]", "moves 'depth' but must move one of height, tilt_y"),
        ("[[motor]]\nmoves = 'height'\n[simulated]", "has no device"),
        ("[[motor]]\nmoves = 'turn'\ndevice = 'R'\nlimits = [0, 1]\n[simulated]", "has no unit"),
        ("[[motor]]\nmoves = 'height'\ndevice = 'Z'\n[simulated]", "needs limits"),
        (
            "[[motor]]\nmoves = 'height'\ndevice = 'Z'\nlimits = ['1 mm', '0 mm']\n[simulated]",
            "below the second",
        ),
        ("[[motor]]\nmoves = 'height'\ndevice = 'Z'\nstep = '1 deg'\n[simulated]", "is not a length"),
        ("[[motor]]\nmoves = 'height'\ndevice = 'Z'\nspeed = 3\n[simulated]", "no key 'speed'"),
        ("[[motor]]\n", "either config, a file of Micro-Manager, or a table .simulated."),
        ("[simulated]", "no ..motor.."),
        ("= 3", "is not TOML"),
    ],
)
def test_what_is_wrong_with_a_bench_file_is_one_line(tmp_path, text, message):
    (tmp_path / "bench.toml").write_text(text)
    with pytest.raises(FormatError, match=message):
        read_setup(tmp_path / "bench.toml")


BENCH = """
camera = "Camera"
[simulated]
seed = 3
[[motor]]
moves = "shift_x"
device = "ArrayXY"
coordinate = "x"
step = "0.1 um"
backlash = "20 um"
limits = ["-1 mm", "1 mm"]
[[motor]]
moves = "turn"
device = "Rotation"
unit = "0.001 deg"
step = "0.001 deg"
backlash = "0.05 deg"
limits = ["-3 deg", "3 deg"]
"""


def test_the_verb_aligns_a_bench_of_devices_in_a_process_of_its_own(tmp_path, camera):
    (tmp_path / "bench.toml").write_text(BENCH)
    (tmp_path / "camera.toml").write_text(camera.to_toml())
    words = ["align", "bench.toml", "--camera", "camera.toml", "--json", "--report", "report.html"]
    run = subprocess.run(
        [sys.executable, "-m", "lumigraph", *words], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
    found = json.loads(run.stdout)
    assert found["status"] == "aligned"
    assert abs(found["shift_x"]) < 5e-6
    assert abs(found["turn"]) < 3.5e-4
    assert "White images" in (tmp_path / "report.html").read_text()
    from lumigraph.viewer.alignment import alignment_site

    site = alignment_site(tmp_path / "bench.log")
    shown = site.calls["step"]({})
    assert shown["step"]["status"] == "aligned"
    assert [row[0] for row in shown["step"]["rows"]] == ["shift x", "turn"]
    assert site.calls["step"]({"number": 0})["step"]["instructions"]


CONFIGURATION = """
# Devices
{stage}
#py pyDevice,Eye,seeing_devices,Eye
Property,Core,Initialize,1
{prefix}Property,Core,XYStage,ArrayXY
"""
SEEN = """
config = "bench.cfg"
camera = "Eye"
[[motor]]
moves = "shift_y"
device = "ArrayXY"
coordinate = "y"
limits = ["-1 mm", "1 mm"]
[[motor]]
moves = "shift_x"
device = "ArrayXY"
coordinate = "x"
limits = ["-1 mm", "1 mm"]
"""


@pytest.mark.parametrize(
    ("stage", "prefix"),
    [("#py pyDevice,ArrayXY,seeing_devices,XY", "#py "), ("Device,ArrayXY,DemoCamera,DXYStage", "")],
)
def test_devices_of_a_micro_manager_configuration_are_aligned(camera, stage, prefix, tmp_path, monkeypatch):
    """Devices in Python, and Micro-Manager's own where its adapters are installed."""
    if not prefix:
        pytest.importorskip("mm_test_adapters", reason="Micro-Manager's adapters are not installed")
    from lumigraph.metrology.alignment import unicore

    made = simulated(setup_of({"motor": list(MOTORS[1:3]), "simulated": {}}), camera)
    module = ModuleType("seeing_devices")
    eye = Dim(camera.replace(sensor={"shape": (8, 8)}), {}, (), np.random.default_rng(0))
    for name, kind, given in (("XY", unicore._XYStage, list(made.motors)), ("Eye", unicore._Camera, eye)):
        begun = lambda self, kind=kind, given=given: kind.__init__(self, given)  # noqa: E731 (one a device)
        setattr(module, name, type(name, (kind,), {"__init__": begun}))
    monkeypatch.setitem(sys.modules, "seeing_devices", module)
    (tmp_path / "bench.cfg").write_text(CONFIGURATION.format(stage=stage, prefix=prefix))
    (tmp_path / "bench.toml").write_text(SEEN)
    devices = lg.metrology.open_bench(tmp_path / "bench.toml", camera)

    class Out:
        rng = np.random.default_rng(1)

        def truth(self):
            x, y = devices.core.getXYPosition("ArrayXY")
            return dict.fromkeys(STATES, 0.0) | {"shift_y": 2e-4 - y * 1e-6, "shift_x": x * 1e-6 - 1e-4}

    out = Out()
    (*_, last) = lg.metrology.align(devices, ByRays(camera).shows(out), goal=GOAL)
    assert last.status == "aligned"
    assert [one.sign for one in last.belief.motors] == [-1, 1]
    assert max(abs(out.truth()[one]) for one in ("shift_y", "shift_x")) < 5e-6


def test_a_configuration_that_cannot_be_loaded_is_one_line(camera, tmp_path):
    (tmp_path / "bench.toml").write_text(SEEN)
    with pytest.raises(BenchError, match=r"no configuration file .*bench.cfg. Correct config"):
        lg.metrology.open_bench(tmp_path / "bench.toml", camera)
    (tmp_path / "bench.cfg").write_text("Device,Eye,NoSuchAdapter,Eye\n")
    with pytest.raises(BenchError, match=r"cannot load .*NoSuchAdapter") as told:
        lg.metrology.open_bench(tmp_path / "bench.toml", camera)
    assert "\n" not in str(told.value)


def test_moves_are_chosen_for_what_they_tell_only_where_another_exposure_follows():
    setup = setup_of({"motor": [{**one, "sign": 1} for one in MOTORS[1:3]], "simulated": {}})
    belief = (
        Belief.before(setup)
        .moved(0, 0.0, 1)
        .moved(1, 0.0, 1)
        .seen(ByRays.rays, _shown(shift_y=1e-4, shift_x=1e-4))
    )
    sure = next_moves(belief, [0.0, 0.0], lg.metrology.AlignmentGoal().tolerances, ByRays.rays)
    assert [one.side for one in sure] == [1, 1]
    unsure = next_moves(belief.widened("shift_y", 2e-5), [0.0, 0.0], GOAL.tolerances, ByRays.rays)
    assert [one.side for one in unsure] == [-1, -1]
