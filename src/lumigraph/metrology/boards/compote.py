r"""COMPOTE's `intrinsics.json`: a multi-focus camera, its lenslets and micro-images.

Lengths are in millimetres, but for micro-images, in pixels from the centre of pixel (0, 0). The frame is the
main lens': X to the right, Y down, Z towards the scene. Rotations are stored column by column. Distortion is
a polynomial in the image point's distance from the axis, equal to `MetricCamera`'s for points at the file's
``dist_focus``. The format holds neither gains nor uncertainties. Conventions: docs/theory/metric.md.

M. Labussiere et al., "Leveraging blur information for plenoptic camera calibration", IJCV 130 (2022), has the
model; the conventions were checked on a published data set, whose 14,346 corners they explain to 0.7 px.
"""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from lumigraph.calibration.vectors import UNEQUAL
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice, Layout
from lumigraph.errors import FormatError
from lumigraph.metrology.boards.camera import MetricCamera

_MM = 1e-3
_SIN60 = math.sqrt(3) / 2
_GEOMETRIES = {"square": 0, "rectangular": 0, "hex": 1}
_SEEN = 0.01  # px by which micro-images may be irregular without a note
_WIDEST = 0.05  # px by which a lattice may be sheared at its end without a note


def is_intrinsics(found: dict[str, Any]) -> bool:
    """True if a JSON object is such a file."""
    return {"mia", "mla", "main_lens", "sensor"} <= found.keys()


def camera_of(found: dict[str, Any]) -> tuple[MetricCamera, Calibration]:
    """Camera and micro-images of a file's JSON object.

    Raises
    ------
    FormatError
        Depth distortion, or columns of hexagons, which are not read.
    """
    if np.any(_array(found["distortions"].get("depth", [0.0]))):
        raise FormatError("distortions.depth is not 0, which a MetricCamera does not have. Fit it without.")
    lattice, shape = _lattice(found), tuple(int(found["sensor"][name]) for name in ("height", "width"))
    pixel, f = (float(found[part][name]) * _MM for part, name in (("sensor", "scale"), ("main_lens", "f")))
    at, normal = _plane(found)
    sensor = _row(found["sensor"]["pose"]["translation"], 3) * _MM
    L = -float(at[2] + (normal[:2] @ at[:2]) / normal[2])
    b = -float(sensor[2]) - L
    axis = (shape[0] - 1 + sensor[1] / pixel, shape[1] - 1 + sensor[0] / pixel)
    seen = _pitch(found, "mia") * pixel
    ratio = float(np.mean(seen / (_pitch(found, "mla") * _MM)))
    if not ratio > 1:
        raise FormatError(
            f"mia.mesh.pitch is {ratio:.6g} of mla.mesh.pitch but must be more: an exit pupil has a place."
        )
    tilt = -normal[:2] / normal[2]
    radial, tangential = _distortion(found, f)
    camera = MetricCamera(
        f, L, b, b / (ratio - 1), pixel, (float(axis[0]), float(axis[1])), (float(tilt[1]), float(tilt[0])),
        radial, tangential, (1.0,) * lattice.kinds,
    )  # fmt: skip
    indices = lattice.indices((0, shape[0] - 1), (0, shape[1] - 1))
    return camera, Calibration(
        lattice, (shape[0], shape[1]), indices, lattice.position(indices), math.nan, pixel, L, b,
        notes=tuple(_told(found, camera, lattice, (shape[0], shape[1]))),
    )  # fmt: skip


def intrinsics_of(
    camera: MetricCamera,
    calibration: Calibration,
    *,
    distance: float | None = None,
    f_number: float | None = None,
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """The JSON object of a camera, and what it leaves out, one sentence each.

    Parameters
    ----------
    camera, calibration
        Lengths, and the micro-images that belong to them.
    distance
        At which distortion is the same [m]; the plane whose image is in the lenslets if left out.
    f_number
        Of the main lens, which COMPOTE needs to know what light passes; left out where it is not known.

    Raises
    ------
    FormatError
        No distance, and no plane in front of the lens has its image in the lenslets.
    """
    f, L, pixel = camera.focal_length, camera.separation, camera.pixel_pitch
    if distance is None:
        if f >= L:
            raise FormatError(
                f"no plane has its image in the lenslets, {L * 1e3:.4g} mm from a lens of {f * 1e3:.4g} mm. "
                "Give the distance of what was seen."
            )
        distance = f * L / (L - f)
    if distance <= f:
        raise FormatError(f"distance is {distance * 1e3:.4g} mm but must be beyond f, {f * 1e3:.4g} mm.")
    image = f * distance / (distance - f) / _MM
    rows, columns = calibration.shape
    back = [pixel * (a - n + 1) / _MM for a, n in zip(camera.axis[::-1], (columns, rows), strict=True)]
    mesh, ends = _mesh(calibration)
    node, turn = _array_pose(camera, ends, mesh)
    plain = {
        "D": -node[2], "d": (L + camera.lenslet_distance) / _MM + node[2], "I": len(camera.gains),
        "dist_focus": distance / _MM,
        "main_lens": {"f": f / _MM, "pose": _pose(np.eye(3), [0.0, 0.0, 0.0])},
        "distortions": {
            "model": 0, "depth": [[0.0, 0.0, 0.0]],
            "radial": [[k / image ** (2 * n) for n, k in enumerate(camera.radial, 1)]],
            "tangential": [[-p / image for p in camera.tangential[::-1]]],
        },
        "mia": {"mesh": mesh},
        "mla": {
            "focal_lengths": [],
            "mesh": mesh | {
                "pitch": [[p * _shrunk(camera) for p in mesh["pitch"][0]]], "pose": _pose(turn, node),
            },
        },
        "sensor": {
            "width": columns, "height": rows, "scale": pixel / _MM,
            "pose": _pose(np.eye(3), [*back, -(L + camera.lenslet_distance) / _MM]),
        },
    }  # fmt: skip
    if f_number is not None:
        plain["main_lens"] |= {"aperture": f_number, "diameter": f / f_number / _MM}
    return plain, tuple(_left_out(camera, calibration, f_number))


def _left_out(camera: MetricCamera, calibration: Calibration, f_number: float | None) -> Iterator[str]:
    yield "uncertainties, noise and the board's poses are not in COMPOTE's intrinsics"
    yield "the focal lengths of the lenslets were not measured: none are written, as of pinholes"
    if any(camera.radial) or any(camera.tangential):
        yield "distortion is that of points at dist_focus: COMPOTE's changes with the image's distance"
    if f_number is None:
        yield "main_lens.aperture is missing: give the f-number"
    if len(camera.gains) > 1 and np.ptp(camera.gains) > 0:
        shown = ", ".join(f"{g:.4g}" for g in camera.gains)
        yield f"gains of the kinds of lenslets ({shown}) are not held: COMPOTE has none"
    yield from _irregular(camera, calibration.shape)
    if calibration.warp is not None:
        yield "the warp of the micro-images' lattice is not held"
    if calibration.aside is not None:
        yield "places of single lenslets beside the lattice are not held"
    shear = _shear(calibration.lattice) * max(calibration.shape)
    if abs(shear) > _WIDEST:
        yield f"the lattice is sheared by {shear:.2g} px over the picture, which a mesh does not hold"


def _irregular(camera: MetricCamera, shape: tuple[int, int]) -> Iterator[str]:
    """Remarks on irregularity by a tilted array: of lenslets in `MetricCamera`, of images in COMPOTE."""
    corner = math.hypot(*shape) / 2 * camera.pixel_pitch
    off = corner**2 * math.hypot(*camera.tilt) / camera.exit_pupil / camera.pixel_pitch
    if off > _SEEN:
        yield f"micro-images of a tilted array are not regular: up to {off:.2g} px at corners is left out"


def _shear(lattice: Lattice) -> float:
    """Shear of the rows: their slip for each pixel down, beyond the layout's own."""
    row, down = _axes(lattice)
    return float(row @ down / (np.hypot(*row) * np.hypot(*down)))


def _axes(lattice: Lattice) -> tuple[np.ndarray, np.ndarray]:
    """Steps (x, y) along the row, and straight to the next row."""
    row, column = (np.array(vector[::-1]) for vector in lattice.basis)
    return row, column - row / 2 if lattice.layout == "hex" else column


def _mesh(calibration: Calibration) -> tuple[dict[str, Any], np.ndarray]:
    """Mesh of the micro-images; and the place (x, y) [px] of its last node, which is the array's first."""
    lattice = calibration.lattice
    row, down = _axes(lattice)
    (i0, j0), (i1, j1) = _box(calibration)
    rows, columns = i1 - i0 + 1, j1 - j0 + 1
    start = lattice.position(np.array([i0, j0]))[::-1]
    first = start - row / 2 if lattice.layout == "hex" else start
    across, along = math.hypot(*row), float(down @ [-row[1], row[0]]) / math.hypot(*row)
    turn = np.array([[row[0], -row[1]], [row[1], row[0]]]) / across
    high = along / (_SIN60 if lattice.layout == "hex" else 1.0)
    mesh = {
        "geometry": _GEOMETRIES[lattice.layout], "width": columns, "height": rows, "pitch": [[across, high]],
        "pose": {"rotation": turn.T.tolist(), "translation": [first.tolist()]},
    }  # fmt: skip
    return mesh, first + turn @ _node(mesh, columns - 1, rows - 1)


def _box(calibration: Calibration) -> tuple[tuple[int, int], tuple[int, int]]:
    """First and last index (i, j) of a mesh over the picture, whose kinds begin with 0 and rows are even.

    Rows of a hexagonal mesh begin at the left edge, not along the lattice's second vector.
    """
    lattice, shape = calibration.lattice, calibration.shape
    pairs = calibration.indices_within((0, shape[0] - 1), (0, shape[1] - 1))
    i0, i1 = int(pairs[:, 0].min()), int(pairs[:, 0].max())
    start = pairs[:, 1] + (pairs[:, 0] - i0 + 1) // 2 * (lattice.layout == "hex")
    j0, j1 = int(start.min()), int(start.max())
    if lattice.layout == "square":
        return (i0, j0), (i1, j1)
    return (i0, j0 - (j0 - i0) % 3), (i1 + (i1 - i0 + 1) % 2, j1)


def _node(mesh: dict[str, Any], k: int, row: int) -> np.ndarray:
    """Place (x, y) of a node in its mesh: even rows of hexagons begin half a pitch later."""
    across, down = _row(mesh["pitch"], 2)
    hexagons = int(mesh["geometry"]) == 1
    return np.array(
        [across * (k + 0.5 * (hexagons and row % 2 == 0)), down * row * (_SIN60 if hexagons else 1)]
    )


def _array_pose(
    camera: MetricCamera, last: np.ndarray, mesh: dict[str, Any]
) -> tuple[np.ndarray, np.ndarray]:
    """Position [mm] of the array's mesh and its rotation; its first lenslet has the last micro-image."""
    tilt = np.array(camera.tilt[::-1])
    flat = _array(mesh["pose"]["rotation"]).reshape(2, 2).T
    normal = np.array([-tilt[0], -tilt[1], 1.0])
    normal /= np.linalg.norm(normal)
    along = np.append(flat[:, 0], tilt @ flat[:, 0])
    along /= np.linalg.norm(along)
    turn = np.stack([along, np.cross(normal, along), normal], axis=1)
    lens = -(last - np.array(camera.axis[::-1])) * _shrunk(camera)
    spot = np.array([*lens, -camera.separation / _MM + tilt @ lens])
    bare = {"geometry": mesh["geometry"], "pitch": _row(mesh["pitch"], 2) * _shrunk(camera)}
    return spot - turn @ np.append(_node(bare, 0, 0), 0.0), turn


def _shrunk(camera: MetricCamera) -> float:
    """Lenslets' pitch [mm] over their micro-images' [px]."""
    return camera.pixel_pitch / _MM * camera.exit_pupil / (camera.exit_pupil + camera.lenslet_distance)


def _pose(turn: np.ndarray, at: Any) -> dict[str, Any]:
    return {"rotation": turn.T.tolist(), "translation": [list(map(float, at))]}


def _lattice(found: dict[str, Any]) -> Lattice:
    mesh = found["mia"]["mesh"]
    if int(mesh["geometry"]) not in _GEOMETRIES.values():
        raise FormatError(
            f"mia.mesh.geometry is {mesh['geometry']} but must be 0 (square) or 1 (rows of hexagons)."
        )
    across, down = _row(mesh["pitch"], 2)
    oblong = max(across, down) > UNEQUAL * min(across, down)
    regular: Layout = "rectangular" if oblong else "square"
    layout = "hex" if int(mesh["geometry"]) == _GEOMETRIES["hex"] else regular
    turn = _array(mesh["pose"]["rotation"]).reshape(2, 2).T
    row, column = turn @ [across, 0.0], turn @ [0.0, down]
    at = _row(mesh["pose"]["translation"], 2)
    if layout == "hex":
        column, at = column * _SIN60 + row / 2, at + row / 2
    kinds = 3 if layout == "hex" and int(found["I"] or 0) == 3 else 1
    return Lattice(
        ((float(row[1]), float(row[0])), (float(column[1]), float(column[0]))), (at[1], at[0]), layout, kinds
    )


def _plane(found: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """A point [m] of the array's plane, and its normal."""
    pose = found["mla"]["mesh"]["pose"]
    return _row(pose["translation"], 3) * _MM, _array(pose["rotation"]).reshape(3, 3)[2]


def _distortion(found: dict[str, Any], f: float) -> Any:
    """Radial and tangential, for points at the file's dist_focus."""
    distance = float(found["dist_focus"]) * _MM
    if not distance > f:
        raise FormatError(f"dist_focus is {distance * 1e3:.4g} mm but must be beyond f, {f * 1e3:.4g} mm.")
    image = f * distance / (distance - f) / _MM
    radial = [k * image ** (2 * n) for n, k in enumerate(_row(found["distortions"]["radial"], 3), 1)]
    across, down = (-float(p) * image for p in _row(found["distortions"]["tangential"], 2))
    return tuple(map(float, radial)), (down, across)


def _told(
    found: dict[str, Any], camera: MetricCamera, lattice: Lattice, shape: tuple[int, int]
) -> Iterator[str]:
    yield "lattice and lengths are COMPOTE's, not measured on a picture; it gives no uncertainties"
    yield from _irregular(camera, shape)
    last = found["mia"]["mesh"]
    at = _row(last["pose"]["translation"], 2) + _array(last["pose"]["rotation"]).reshape(2, 2).T @ _node(
        last, int(last["width"]) - 1, int(last["height"]) - 1
    )
    mesh = {name: last[name] for name in ("geometry", "pitch", "pose")}
    meant = _array_pose(camera, at, mesh)[0][:2]
    off = _row(found["mla"]["mesh"]["pose"]["translation"], 2, of=3) - meant
    if np.hypot(*off) > 1e-3:
        yield (
            f"its array stands {off[0] * 1e3:.1f} µm across and {off[1] * 1e3:.1f} µm down from where an "
            "exit pupil on the axis puts it, which is left out"
        )


def _pitch(found: dict[str, Any], part: str) -> np.ndarray:
    return _row(found[part]["mesh"]["pitch"], 2)


def _row(value: Any, count: int, of: int | None = None) -> np.ndarray:
    """The first `count` numbers of a list in a list, which must have `of`."""
    numbers = _array(value).ravel()
    if len(numbers) != (of or count) or not np.isfinite(numbers).all():
        raise FormatError(f"{str(value)[:60]} must be {of or count} finite numbers.")
    return numbers[:count]


def _array(value: Any) -> np.ndarray:
    return np.asarray(value, dtype=np.float64)  # of numbers, or of their texts
