"""Simulated benches that align themselves: how many get there, in how many exposures, and what they claim.

``python -m benchmarks.alignment [--runs 50] [--seed 0] [--lenslets 41] [--exact]`` draws ±1 degree of turn
and tilts, ±0.3 mm of height, x and y, ±5 % of the stop, backlash up to 20 µm, signs, 1 % noise and 2 % drift
of the light; the devices are those of UniMMCore. The lenslets' pitch is off by what `pitch_error` says.
``--exact`` makes the benches' white images lenslet by lenslet (`benchmarks.twin`), not by the operator.
``--hours 2`` watches one bench that drifts by 5 µm and 0.01 degree an hour instead, with an exposure a
minute. ``--camera thesis-plenoptic-1`` takes the thesis' prototype at full size; ``--microscope`` a
light-field microscope, whose aperture has no motor and is known to 0.05 % (one standard deviation).
"""

import argparse
import math
import time
from collections import Counter

import numpy as np
from scipy.stats import chi2

import lumigraph as lg
from benchmarks import twin
from lumigraph.instruments.telecentric import is_telecentric
from lumigraph.metrology.alignment.moves import tolerance
from lumigraph.metrology.alignment.setup import STATES, setup_of
from lumigraph.metrology.alignment.simulated import SimulatedBench, simulated
from lumigraph.metrology.alignment.unicore import simulated_devices

PITCH_ERROR = 5e-6
LENGTH = {"step": "0.1 um", "backlash": "20 um", "limits": ["-1 mm", "1 mm"]}
ANGLE = {
    "unit": "0.001 deg", "step": "0.001 deg", "backlash": "0.05 deg", "limits": ["-3 deg", "3 deg"],
}  # fmt: skip
MOTORS = [
    {"moves": "height", "device": "ArrayZ", **LENGTH},
    {"moves": "shift_y", "device": "ArrayXY", "coordinate": "y", **LENGTH},
    {"moves": "shift_x", "device": "ArrayXY", "coordinate": "x", **LENGTH},
    {"moves": "tilt_y", "device": "TiltY", **ANGLE},
    {"moves": "tilt_x", "device": "TiltX", **ANGLE},
    {"moves": "turn", "device": "Rotation", **ANGLE},
    {
        "moves": "aperture", "device": "Stop", "property": "Diameter", "unit": "0.01 %", "step": "0.01 %",
        "backlash": "0.2 %", "limits": ["-20 %", "20 %"],
    },
]  # fmt: skip
PUPIL_ERROR = 5e-4
"""Of a microscope's aperture, which has no motor."""


def microscope(count):
    """A light-field microscope 20x/0.4 with count x count lenslets."""
    return lg.LightFieldMicroscope(
        wavelength="550 nm",
        objective={"magnification": 20.0, "numerical_aperture": 0.4},
        lenslets={"pitch": "125 um", "focal_length": "2.5 mm", "count": (count, count)},
        sensor={"pixel_pitch": "6.5 um", "black_level": 64},
    )


class ExactBench(SimulatedBench):
    """A simulated bench whose white images are made lenslet by lenslet."""

    def light(self, truth):
        """White image (y, x) of a camera file whose array leans."""
        pixels = math.ceil(0.6e-3 / self.camera.sensor.pixel_pitch)
        meant = self.camera.replace(sensor={"shape": tuple(n + 2 * pixels for n in self.camera.sensor.shape)})
        true = [
            truth[name] for name in ("height", "tilt_y", "tilt_x", "shift_y", "shift_x", "turn", "aperture")
        ]
        return twin.stood(meant, true, truth["pitch"])[pixels:-pixels, pixels:-pixels]


def drawn(camera, seed, exact=False, **options):
    """A bench of UniMMCore's devices, and what it simulates."""
    scope = is_telecentric(camera)
    table = {"camera": "Camera", "drift": "5 um", "simulated": {"seed": seed, **options}}
    table["motor"] = MOTORS[:-1] if scope else MOTORS
    setup = setup_of(table | ({"known": {"aperture": PUPIL_ERROR}} if scope else {}))
    made = simulated(setup, camera)
    made.state["aperture"] = (
        PUPIL_ERROR * float(made.rng.standard_normal()) if scope else made.state["aperture"]
    )
    made.state["pitch"] = PITCH_ERROR * float(made.rng.standard_normal())
    if exact:
        names = ("camera", "state", "motors", "rng", "noise", "fading", "drift", "vibration", "frozen")
        made = ExactBench(**{name: getattr(made, name) for name in names})
    return simulated_devices(setup, made), made


def aligned(reader, seed, exact):
    """One bench: exposures, what is left, whether that is within the covariance, CPU seconds an exposure."""
    bench, made = drawn(reader.camera, seed, exact)
    goal, kinds = lg.metrology.AlignmentGoal(pitch_error=PITCH_ERROR), Counter()
    began, steps = time.process_time(), lg.metrology.align(bench, reader, goal=goal)
    step = None
    for step in steps:
        kinds[step.status] += 1
    spent = time.process_time() - began
    truth, belief = made.truth(), step.belief
    names = [one.moves for one in belief.motors]
    places = [STATES.index(name) for name in names]
    off = belief.mean[places] - np.array([truth[name] for name in names])
    far = float(off @ np.linalg.solve(belief.covariance[np.ix_(places, places)], off))
    left = {name: truth[name] / tolerance(goal.tolerances, name) for name in names}
    return {
        "seed": seed, "status": step.status, "exposures": sum(kinds.values()) - kinds["learning"],
        "learning": kinds["learning"], "left": left, "inside": far < chi2.ppf(0.95, len(names)),
        "backlash": [
            (belief.backlash(k)[0] - one.backlash) / max(belief.backlash(k)[1], 1e-12)
            for k, one in enumerate(made.motors)
        ],
        "cpu": spent / sum(kinds.values()),
    }  # fmt: skip


def many(reader, runs, seed, exact):
    """Print the table of many benches."""
    found = []
    for number in range(runs):
        one = aligned(reader, seed + number, exact)
        found.append(one)
        worst = max(one["left"], key=lambda name: abs(one["left"][name]))
        print(
            f"bench {one['seed']}: {one['status']} in {one['exposures']} + {one['learning']} exposures; "
            f"farthest {worst} {abs(one['left'][worst]):.2f} of its tolerance; inside 95 %: {one['inside']}",
            flush=True,
        )  # fmt: skip
    good = sum(max(map(abs, one["left"].values())) <= 1 and one["status"] == "aligned" for one in found)
    counts = (dict(Counter(one[name] for one in found)) for name in ("exposures", "learning"))
    print("{} of {} within tolerance; exposures {}, and {} to learn signs".format(good, runs, *counts))
    print(f"{sum(one['inside'] for one in found)} of {runs} within the covariance stated at 95 %")
    for name in found[0]["left"]:
        print(f"{name:9s} worst {max(abs(one['left'][name]) for one in found):.2f} of the tolerance")
    known = np.abs([one["backlash"] for one in found])
    print(f"backlash within 1.96 of its standard deviation in {np.mean(known < 1.96):.0%}")
    print(f"{np.mean([one['cpu'] for one in found]):.1f} CPU s an exposure, simulation included")


def kept(reader, hours, seed):
    """Print how well a drifting bench is kept."""
    lengths = dict.fromkeys(("height", "shift_y", "shift_x"), "5 um")
    angles = dict.fromkeys(("tilt_y", "tilt_x", "turn"), "0.01 deg")
    bench, made = drawn(reader.camera, seed, drift={**lengths, **angles})
    goal = lg.metrology.AlignmentGoal(pitch_error=PITCH_ERROR)
    worst, steps, moved = {}, [], 0
    for step in lg.metrology.watch(bench, reader, seconds=3600 * hours, goal=goal):
        steps.append(step.values())
        truth, started = made.truth(), any(one["status"] == "aligned" for one in steps)
        for motor in step.belief.motors if started else ():
            part = abs(truth[motor.moves]) / tolerance(goal.tolerances, motor.moves)
            worst[motor.moves] = max(worst.get(motor.moves, 0.0), part)
        moved += len(step.moves)
    print(f"{len(steps)} exposures, {moved} moves; farthest, of the tolerance: "
          + ", ".join(f"{name} {part:.2f}" for name, part in worst.items()))  # fmt: skip
    for row in lg.metrology.drift_table(steps):
        print("  ".join(f"{cell:>22s}" for cell in row))


def main():
    """Run what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--lenslets", type=int, default=41)
    parser.add_argument("--exact", action="store_true")
    parser.add_argument("--hours", type=float, default=0.0)
    parser.add_argument("--camera")
    parser.add_argument("--microscope", action="store_true")
    given = parser.parse_args()
    built = microscope if given.microscope else twin.camera
    camera = lg.load_camera(given.camera) if given.camera else built(given.lenslets)
    began = time.process_time()
    reader = lg.metrology.WhiteReader(lg.metrology.white_camera(camera))
    _ = reader.rays
    print(
        f"{time.process_time() - began:.1f} CPU s once for the camera, {camera.sensor.shape} px", flush=True
    )
    if given.hours:
        kept(reader, given.hours, given.seed)
    else:
        many(reader, given.runs, given.seed, given.exact)


if __name__ == "__main__":
    main()
