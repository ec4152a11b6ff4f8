"""Cameras drawn by chance, measured by boards from raw pictures: how often the truth is in the intervals.

``python -m benchmarks.boards focused | kinds | views [--runs 25] [--first 0] [--seed 0] [--known 0.02]``:
each run draws a camera (focal length, distances, exit pupil, axis, tilt, distortion, gains of the kinds). It
gives a white image and pictures of a board at drawn poses, by rays and with 1 % of noise. The array is
calibrated on the white image, corners are found, and `lg.metrology.board` measures the camera, told a focal
length that is off by chance, as a data sheet's is, by ``--known`` (one standard deviation); with ``--pitch
1e-4`` the lenslets' pitch, too, off by that part. ``--planned 8`` takes eight pictures at the poses of
`lg.metrology.plan`, instead of five (of a camera 1.0 six) drawn ones near the plane in focus. A point that took
no part is triangulated with the result, from places as exact as corners are.
"""

import argparse
import sys
import time
import warnings
from dataclasses import replace

import numpy as np

import lumigraph as lg

TRIES = 10
"""Until a pose where no board is found is left out."""

NAMES = ("focal_length", "separation", "lenslet_distance", "distance of a point")
ENOUGH = (1e-2, 1e-2, 1e-2, 3e-3)
"""Errors over the truth that are asked for."""


def camera_2_0(rng, kinds):
    """Keplerian or Galilean, in focus near 0.45 m."""
    from metrology import drawn

    meant = drawn.camera(rng.choice([-1.0, 1.0]), kinds)
    gains = 1 + rng.normal(0, 5e-3, kinds)
    b = meant.lenslet_distance * rng.uniform(0.95, 1.05)
    image = meant.focal_length * 0.45 / (0.45 - meant.focal_length)
    separation = image + (meant.separation - image) * rng.uniform(0.9, 1.1)
    gains = tuple(gains / gains.mean())
    return replace(
        meant, separation=separation, lenslet_distance=b, exit_pupil=rng.uniform(0.75, 1.1) * separation,
        **beside(rng, meant), gains=gains,
    )  # fmt: skip


def beside(rng, meant):
    """Axis, tilt and distortion."""
    axis = tuple(np.array(meant.axis) + rng.normal(0, 5, 2))
    radial = (rng.normal(0, 0.05), 0.0, 0.0)
    return {"axis": axis, "tilt": tuple(rng.normal(0, 7e-4, 2)), "radial": radial}


def camera_1_0(rng):
    """In focus near 0.41 m."""
    from metrology import drawn_views

    meant = drawn_views.CAMERA
    return replace(
        meant, separation=57e-3 * rng.uniform(0.997, 1.003), lenslet_distance=0.9e-3 * rng.uniform(0.9, 1.1),
        exit_pupil=57e-3 * rng.uniform(0.75, 1.1), **beside(rng, meant),
    )  # fmt: skip


def pose(rng, distance, board):
    """Where a board is: its middle near the axis, leaning up to 0.45 rad about both axes."""
    from metrology import drawn

    turn = (rng.uniform(-0.1, 0.1), *rng.uniform(-0.45, 0.45, 2))
    return drawn.pose(turn, float(distance + rng.uniform(-3e-3, 3e-3)), board)


def drawn_poses(rng, board, views):
    """Functions that draw the pose of each picture: near the plane in focus."""
    distances = rng.permutation(np.linspace(0.36, 0.46, 6) if views else np.linspace(0.43, 0.47, 5))
    return [lambda distance=one: pose(rng, distance, board) for one in distances]


def planned_poses(rng, camera, board, nominal, count, views):
    """The same, as `lg.metrology.plan` asks for by what data sheets say, to 3 degrees and 1 %."""
    from metrology import drawn

    plan = lg.metrology.plan(*camera, board, nominal, pictures=count, in_views=views)

    def draw(step):
        turn = np.array(step.turn) + rng.normal(0, 0.05, 3)
        return drawn.pose(tuple(turn), float(step.distance * (1 + rng.normal(0, 0.01))), board)

    return [lambda step=one: draw(step) for one in plan.steps]


def pictures(rng, true, white, found, poses):
    """Corners on pictures, and how many were taken again."""
    from metrology import drawn, drawn_views

    kinds, board, draws = poses
    views, again, frames = not kinds, 0, []
    for draw in draws:
        for _ in range(TRIES):
            where = draw()
            raw = (
                drawn_views.raw(where, rng, seen_by=true) if views else drawn.raw(true, where, kinds, rng=rng)
            )
            ready = lg.prepare(lg.RawImage(raw), found, white=white)
            try:
                one = lg.metrology.find_corners([ready], board, found, in_views=views, wavelength=None)
                break
            except lg.LumigraphError:
                again += 1
        else:
            continue
        frames.append(replace(one, frame=0 * one.frame + len(frames)))
    columns = ("frame", "corner", "place", "center", "kind")
    whole = (np.concatenate([getattr(one, name) for one in frames]) for name in columns)
    return lg.metrology.Corners(*whole, in_views=views), again


def run(rng, what, known, pitch=None, planned=None):
    """Deviations of `NAMES` over the truth, and over what is said; residual [px]; pictures taken again."""
    from metrology import drawn, drawn_views

    kinds = {"focused": 1, "kinds": 3, "views": 0}[what]
    drawing = drawn if kinds else drawn_views
    true = camera_2_0(rng, kinds) if kinds else camera_1_0(rng)
    white = drawing.white(kinds) if kinds else drawing.white()
    found = lg.calibrate(white)
    if kinds == 3:  # which lenslets are of which kind no white image tells
        found = drawing.calibration(kinds)
    told = true.focal_length * (1 + rng.normal(0, known))
    nominal = lg.metrology.Nominal(told, true.pixel_pitch, drawing.SHAPE, focal_length_error=known)
    if pitch:
        lenslets = drawing.PITCH / (1 + true.lenslet_distance / true.exit_pupil) * (1 + rng.normal(0, pitch))
        nominal = replace(nominal, pitch_ratio=found.lattice.pitch / lenslets, pitch_ratio_error=pitch)
    board = drawing.BOARD
    if planned:
        draws = planned_poses(rng, (true, found), board, nominal, planned, not kinds)
    else:
        draws = drawn_poses(rng, board, not kinds)
    corners, again = pictures(rng, true, white, found, (kinds, board, draws))
    measured = lg.metrology.board(corners, board, nominal)
    off = measured.camera.numbers[:3] - true.numbers[:3]
    point = np.array([rng.uniform(0.43, 0.47), *rng.uniform(-3e-3, 3e-3, 2)])
    seen, noise = sighted(true, point, found, not kinds), measured.residual_px
    seen = (seen[0] + rng.normal(0, noise, seen[0].shape), seen[1])
    place = lg.metrology.triangulate(measured, *seen, in_views=not kinds)
    off = np.append(off, place.position[0] - point[0])
    truth = np.append(true.numbers[:3], point[0])
    said = np.append(measured.errors[:3], place.errors[0])
    return off / truth, off / said, measured.residual_px, again


def sighted(true, point, found, views):
    """Places and centres of the micro-images that show a point."""
    if views:
        from metrology import scenes

        way = np.stack(np.meshgrid(*2 * [np.linspace(-4, 4, 7)]), -1).reshape(-1, 2)
        center = scenes.in_views(true, point, way)
        return center + way, center
    rows, columns = found.shape
    center = found.position(found.indices_within((0, rows - 1), (0, columns - 1)))
    place = true.project(point, center)
    shown = np.hypot(*(place - center).T) < 0.42 * found.lattice.pitch
    return place[shown], center[shown]


def summary(part, sure):
    """Lines on errors (runs, `NAMES`), over the truth and over what is said."""
    lines = []
    for k, name in enumerate(NAMES):
        worst, enough = np.abs(part[:, k]).max(), ENOUGH[k]
        rms, of_said = (np.sqrt((one[:, k] ** 2).mean()) for one in (part, sure))
        inside, exact = (
            int((np.abs(one) < limit).sum()) for one, limit in ((sure[:, k], 1.96), (part[:, k], enough))
        )
        lines.append(
            f"{name:20s} mean {part[:, k].mean():+.3%}, rms {rms:.3%}, worst {worst:.3%}, to {enough:.1%} in "
            f"{exact}; {of_said:.2f} of what is said; in the interval {inside} of {len(part)}"
        )
    return "\n".join(lines)


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("focused", "kinds", "views"))
    parser.add_argument("--runs", type=int, default=25)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--known", type=float, default=0.02)
    parser.add_argument("--pitch", type=float)
    parser.add_argument("--planned", type=int)
    given = parser.parse_args()
    sys.path.insert(0, "tests")
    warnings.simplefilter("ignore")
    part, sure, px, again, refused, started = [], [], [], 0, 0, time.process_time()
    for k in range(given.first, given.first + given.runs):
        try:
            one = run(
                np.random.default_rng([given.seed, k]), given.what, given.known, given.pitch, given.planned
            )
        except lg.LumigraphError as error:
            print(f"run {k}: {error}", flush=True)
            refused += 1
            continue
        part.append(one[0])
        sure.append(one[1])
        px.append(one[2])
        again += one[3]
        print(k, *(f"{100 * a:+.3f} % ({b:+.2f})" for a, b in zip(*one[:2], strict=True)), flush=True)
    print(summary(np.array(part), np.array(sure)))
    cost = (time.process_time() - started) / given.runs
    print(
        f"residual {np.median(px):.3f} px in the median; {again} pictures taken again, {refused} runs "
        f"refused; {cost:.1f} CPU s a run"
    )


if __name__ == "__main__":
    main()
