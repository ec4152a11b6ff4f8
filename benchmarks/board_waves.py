"""Cameras 1.0, 2.0 and of three kinds, measured by the command from pictures of boards by wave optics.

``python -m benchmarks.board_waves views | focused | kinds [--runs 3] [--first 0] [--pictures 20] [--each 6]
[--workers 1] [--minutes 60] [--keep FOLDER]``: each run simulates a white image and boards at the poses of
`lg.metrology.plan` through wave optics, exposes them with the sensor's noise, finds corners on the files, and
runs ``lumigraph board`` on their table, told a focal length that is off by 2 % and the lenslets' pitch off by
1e-4 (one standard deviation). Cameras differ in lengths, lenslets' width and wavelength. Poses, noise and
what is told are drawn anew in each run; the camera serves ``--each`` runs, which is what makes many
affordable: lenslets' matrices are computed once for it. Boards
lean, so that each is shared out to slices by its own distance. The last picture takes no part: its best-seen
corner is the point whose distance is asked for. Printed are how far corners are from where rays put them,
the lengths' and a point's errors over the truth (over what is said), and CPU seconds; at the end how many
intervals hold.

Runs are the same whatever the number of processes, and each is printed once it is finished. After
``--minutes`` none begins. ``--keep FOLDER`` keeps raw images, tables and cameras; pictures that are there at
the same poses are not simulated again.
"""

import argparse
import contextlib
import io
import multiprocessing
import os
import queue
import sys
import tempfile
import time
import warnings
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

import lumigraph as lg
from benchmarks.boards import NAMES, planned_poses, summary
from lumigraph.cli import main as command
from lumigraph.metrology.boards import geometry

STEP = {"views": 6e-3, "focused": 2e-3, "kinds": 2e-3}
"""Between slices near the focus [m]: from one to the next, views of a corner move by 0.15 of a sample, places
by 0.2 px."""

BOARDS = {"views": "6 x 5 corners, 3.6 mm", "focused": "12 x 10 corners, 1.1 mm"}
KNOWN, PITCH = 0.02, 1e-4
ACCURACY = 1e-2
PIXEL = 5.5e-6


def camera(rng, what):
    """A camera of a few thousand lenslets, or one of half as many, with a close-up."""
    f, wavelength, wide = 50e-3 * rng.uniform(0.95, 1.05), rng.uniform(480e-9, 640e-9), rng.uniform(0.9, 1.15)
    sensor = {"pixel_pitch": PIXEL, "black_level": 64.0, "full_well": 12000.0, "read_noise": 6.0}
    common = {"wavelength": wavelength, "main_lens": {"focal_length": f}, "sensor": sensor}
    if what == "views":
        own = {"pitch": 62e-6 * wide, "focal_length": 0.9e-3 * rng.uniform(0.9, 1.1), "count": (70, 70)}
        return lg.PlenopticCamera(**common, object_distance=8.2 * f * rng.uniform(0.98, 1.02), lenslets=own)
    focal, apart = 1.9e-3 * rng.uniform(0.95, 1.05), rng.uniform(0.03, 0.05)
    lengths = (focal, (1 + apart) * focal, (1 - apart) * focal) if what == "kinds" else focal
    own = {
        "pitch": 120e-6 * wide, "focal_length": lengths, "count": (44, 38), "layout": "hex",
        "magnification": 0.3 * rng.uniform(0.9, 1.1),
    }  # fmt: skip
    return lg.FocusedPlenopticCamera(**common, object_distance=5 * f, lenslets=own)


def on_board(pose, grid):
    """Places on a board (y, x, 2) that a grid's samples are before [m], and their distances (y, x) [m]."""
    corner, down, across = geometry.moved(np.concatenate([np.zeros((1, 3)), np.eye(3)[1:]]), pose)
    down, across = down - corner, across - corner
    y, x = np.meshgrid(grid.y, grid.x, indexing="ij")
    sides = np.stack([down[1:], across[1:]], -1)
    at = np.stack([y - corner[1], x - corner[2]], -1) @ np.linalg.inv(sides).T
    return at, corner[0] + at @ np.array([down[0], across[0]])


@dataclass
class Bench:
    """A camera, and what its slices and its white image take to compute, once for all of its runs."""

    camera: lg.PlenopticCamera | lg.FocusedPlenopticCamera
    step: float
    made: dict = field(default_factory=dict)

    def number(self, distance):
        """Of slices at distances [m], 0 in focus, as evenly apart in the picture as they can be."""
        return self.camera.object_distance * (1 - self.camera.object_distance / distance) / self.step

    def slice(self, k):
        """The operator of one slice."""
        if k not in self.made:
            distance = self.camera.object_distance / (1 - k * self.step / self.camera.object_distance)
            away = distance - self.camera.object_distance
            self.made[k] = self.camera.operator([away], accuracy=ACCURACY)
        return self.made[k]

    def white(self):
        """Light (y, x) of a white image."""
        if "white" not in self.made:
            self.made["white"] = np.asarray(lg.simulate(self.camera, lg.scene.targets.white()).data)
        return self.made["white"]

    def board(self, board, pose):
        """Light (y, x) on the sensor of a board at a pose."""
        from metrology import drawn

        grid = self.camera.operator_grid()
        at, distance = on_board(pose, grid)
        soft = np.full(at.shape[:2], max(grid.pitch)).ravel()
        bright = drawn.painted(at.reshape(-1, 2), soft, board).reshape(at.shape[:2]).astype(np.float32)
        reach = self.number(geometry.moved(board.points(), pose)[:, 0])
        near = np.clip(self.number(np.maximum(distance, 0.1)), reach.min() - 1, reach.max() + 1)
        lit = 0.0
        for k in range(int(np.floor(near.min())), int(np.ceil(near.max())) + 1):
            part = np.maximum(1 - np.abs(near - k), 0).astype(np.float32)
            if part.any():
                lit = lit + self.slice(k).forward((part * bright)[None])
        return np.maximum(lit, 0)


def exposed(bench, board, poses, rng, folder):
    """Files of the dark and white image and of boards at poses; those of an earlier run at the same ones."""
    names, at = [folder / f"{n}.tif" for n in ("dark", "white", *range(len(poses)))], folder / "poses.npy"
    if at.exists() and np.array_equal(np.load(at), poses):
        return names
    sensor, white = bench.camera.sensor, bench.white()
    lg.io.save(sensor.expose(0 * white, reference=1, rng=rng), names[0])
    lights = (white, *(bench.board(board, pose) for pose in poses))
    for name, light in zip(names[1:], lights, strict=True):
        lg.io.save(sensor.expose(light, reference=white.max(), fill=0.8, rng=rng), name)
    np.save(at, poses)
    return names


def found(bench, board, poses, names, what):
    """Corners on the boards that are found but the last, how far off they are (n, 2) [px], how many boards.

    And the last one's corners, where they are (n, 3) [m], and the calibration of the lenslets.
    """
    dark, white, *boards = (replace(lg.open(name), pixel_pitch=PIXEL) for name in names)
    lenslets, seen = lg.calibrate(np.asarray(white.data) - np.asarray(dark.data)), []
    for raw, pose in zip(boards, poses, strict=True):
        ready = lg.prepare(raw, lenslets, white=white, dark=dark)
        with contextlib.suppress(lg.LumigraphError):
            light = {"in_views": what == "views", "wavelength": bench.camera.wavelength}
            corners = lg.metrology.find_corners([ready], board, **light)
            seen.append(
                (replace(corners, frame=corners.frame + len(seen)), *away(bench.camera, board, corners, pose))
            )
    corners, off, points = zip(*seen, strict=True)
    columns = ("frame", "corner", "place", "center", "kind")
    joined = (np.concatenate([getattr(one, name) for one in corners[:-1]]) for name in columns)
    whole = lg.metrology.Corners(*joined, in_views=what == "views", spill=corners[0].spill)
    return whole, np.concatenate(off), len(corners) - 1, (corners[-1], points[-1]), lenslets


def away(true, board, corners, pose):
    """Corners less where rays put them (n, 2) [px], and where they are (n, 3) [m], from the likelier end."""
    ideal, points = lg.metrology.MetricCamera.of(true), geometry.moved(board.points(), pose)
    ideal, both = replace(ideal, gains=(1.0,)), []
    for each in (points[corners.corner], points[::-1][corners.corner]):
        kind = 0 * corners.kind
        if corners.in_views:
            seen = corners.place, corners.center
            shown = geometry.centers(ideal.numbers, each, seen, kind, ideal.pixel_pitch)
            both.append((corners.center - shown, each))
        else:
            both.append((corners.place - ideal.project(each, corners.center, kind), each))
    return min(both, key=lambda one: float(np.abs(one[0]).mean()))


def run(bench, rng, what, pictures, place):
    """Errors of `NAMES` over the truth, and over what is said; corners off, rms [px]; pictures used.

    Files are in a folder, which a context gives.
    """
    true, written = bench.camera, BOARDS["views" if what == "views" else "focused"]
    board = lg.metrology.Board.from_text(written)
    ideal = lg.metrology.MetricCamera.of(true)
    told, pitch = (1 + rng.normal(0, part) for part in (KNOWN, PITCH))
    nominal = lg.metrology.Nominal(
        told * ideal.focal_length, ideal.pixel_pitch, true.sensor.shape, pitch_ratio_error=PITCH,
        pitch_ratio=1 + ideal.lenslet_distance / ideal.separation,
    )  # fmt: skip
    seen = replace(true.calibration, fill=true.micro_image_fill)
    draws = planned_poses(rng, (ideal, seen), board, nominal, pictures, what == "views")
    poses = [draw() for draw in draws]
    with place as kept:
        names = exposed(bench, board, poses, rng, kept)
        seen, off, pictures, last, lenslets = found(bench, board, poses, names, what)
        lg.metrology.save_corners(seen, kept / "corners.csv")
        mask = pitch * true.lenslets.pitch
        options = {
            "--board": written, "--focal-length": f"{1e3 * nominal.focal_length} mm",
            "--pixel-pitch": f"{1e6 * PIXEL} um", "--lenslet-pitch": f"{1e6 * mask} um",
            "--lenslet-pitch-error": f"{1e6 * PITCH * mask} um",
            "--micro-image-pitch": lenslets.lattice.pitch, "-o": kept / "camera.json",
        }  # fmt: skip
        words = [str(word) for pair in options.items() for word in pair]
        with contextlib.redirect_stdout(io.StringIO()) as out:
            size = map(str, true.sensor.shape)
            if command(["board", str(kept / "corners.csv"), "--shape", *size, *words]):
                raise lg.LumigraphError(out.getvalue())
        measured = lg.metrology.load(kept / "camera.json")
    corners, points = last
    mine = corners.sights() == np.bincount(corners.sights()).argmax()
    point = points[mine][0]
    seen = lg.metrology.triangulate(
        measured, corners.place[mine], corners.center[mine], corners.kind[mine], in_views=what == "views"
    )
    errors = np.append(measured.camera.numbers[:3] - ideal.numbers[:3], seen.position[0] - point[0])
    truth, sure = np.append(ideal.numbers[:3], point[0]), np.append(measured.errors[:3], seen.errors[0])
    unit = lenslets.lattice.pitch if what == "views" else 1.0
    return errors / truth, errors / sure, float(np.sqrt((off**2).mean())) / unit, pictures


@contextlib.contextmanager
def folder(given, k):
    """Where a run's files are: one that stays, or one that goes."""
    if given.keep is None:
        with tempfile.TemporaryDirectory() as name:
            yield Path(name)
        return
    name = given.keep / f"{given.what}-{given.seed}-{k}"
    name.mkdir(parents=True, exist_ok=True)
    yield name


def work(given, todo, done):
    """Runs of cameras, until there are none left or the time is over; each outcome is put into `done`."""
    sys.path.insert(0, "tests")
    warnings.simplefilter("ignore")
    while (which := todo.get()) is not None:
        bench = None
        for k in range(max(which * given.each, given.first), min((which + 1) * given.each, given.last)):
            if time.time() > given.until or not multiprocessing.parent_process().is_alive():
                break
            started = time.process_time()
            try:
                if bench is None:
                    rng = np.random.default_rng([given.seed, 0, which])
                    bench = Bench(camera(rng, given.what), STEP[given.what])
                drawn = np.random.default_rng([given.seed, 1, k])
                one = run(bench, drawn, given.what, given.pictures, folder(given, k))
            except Exception as error:  # whatever it is, other runs go on, and it is printed and counted
                one = f"{type(error).__name__}: {error}"
            done.put((k, one, time.process_time() - started))
    done.put(None)


def outcomes(given):
    """Those of all runs, as they come, from processes that have some processors each."""
    spawned = multiprocessing.get_context("spawn")
    todo, done = spawned.Queue(), spawned.Queue()
    for which in range(given.first // given.each, -(-given.last // given.each)):
        todo.put(which)
    for _ in range(given.workers):
        todo.put(None)
    processes = [spawned.Process(target=work, args=(given, todo, done)) for _ in range(given.workers)]
    all_of_them = sorted(os.sched_getaffinity(0))
    for k, process in enumerate(processes):
        os.sched_setaffinity(0, all_of_them[k :: given.workers] or all_of_them)
        process.start()
    os.sched_setaffinity(0, all_of_them)
    working = given.workers
    while working:
        try:
            one = done.get(timeout=10)
        except queue.Empty:
            if not any(process.is_alive() for process in processes):
                print(f"{working} processes ended early", flush=True)
                return
            continue
        working -= one is None
        if one is not None:
            yield one


def told(given):
    """What is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=tuple(STEP))
    usual = {"runs": 3, "first": 0, "pictures": 20, "seed": 0, "each": 6, "workers": 1}
    for name, value in usual.items():
        parser.add_argument(f"--{name}", type=int, default=value)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--keep", type=Path)
    given = parser.parse_args(given)
    given.last, given.until = given.first + given.runs, time.time() + 60 * given.minutes
    return given


def main():
    """Print the table."""
    given = told(None)
    unit = "lenslets" if given.what == "views" else "px"
    good, spent = [], 0.0
    for k, one, seconds in outcomes(given):
        spent += seconds
        if isinstance(one, str):
            print(f"run {k}: {one}; {seconds:.0f} CPU s", flush=True)
            continue
        good.append(one)
        numbers = (f"{n} {a:+.3%} ({b:+.2f})" for n, a, b in zip(NAMES, *one[:2], strict=True))
        print(
            k,
            f"corners {one[2]:.4f} {unit}, {one[3]} pictures;",
            *numbers,
            f"{seconds:.0f} CPU s",
            flush=True,
        )
    if good:
        part, sure, off, _ = zip(*good, strict=True)
        print(summary(np.array(part), np.array(sure)))
        print(
            f"corners off {np.sqrt(np.mean(np.square(off))):.4f} {unit} rms, {max(off):.4f} at worst; ",
            end="",
        )
    print(f"{len(good)} of {given.runs} runs; {spent:.0f} CPU s")


if __name__ == "__main__":
    main()
