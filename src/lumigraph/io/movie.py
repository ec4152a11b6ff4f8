"""Films: animated GIF through Pillow, MP4 (H.264) through PyAV; written, not read."""

import io
from fractions import Fraction
from pathlib import Path

import numpy as np
from PIL import Image

from lumigraph.core import checks
from lumigraph.core.arrays import Array, to_numpy
from lumigraph.core.stack import Stack
from lumigraph.errors import FormatError
from lumigraph.io import target
from lumigraph.io.png import to_integers

FPS = 10.0
"""Pictures per second where nobody says."""


def save_movie(frames: Array, path: str | Path, *, fps: float = FPS, white: float | None = None) -> None:
    """Write pictures as an animated GIF or an MP4 film, the ending says which; a GIF repeats for ever.

    Parameters
    ----------
    frames
        (n, y, x) or (n, y, x, 3): uint8, or floats of which 0 ... `white` becomes black to white.
    path
        Ends in `.gif` or `.mp4`.
    fps
        Pictures per second, above 0 and at most 1000.
    white
        Float that becomes white; the maximum of all frames if left out.

    Raises
    ------
    FormatError
        Another shape, type or ending, or MP4 without the package av (``pip install 'lumigraph[video]'``).
    """
    place = target.check_target(path, (".gif", ".mp4"))
    if checks.positive("fps", fps, "per second", FormatError) > 1000:
        raise FormatError(f"fps is {fps:g} but must be at most 1000 per second.")
    pictures = _bytes(frames, white)
    if place.name.lower().endswith(".gif"):
        _save_gif(pictures, place, fps)
    else:
        _save_mp4(pictures, place, fps)


def save(stack: Stack, path: Path, *, fps: float = FPS, white: float | None = None) -> None:
    """`save_movie` of a stack's pictures, as `lumigraph.io.save` calls it."""
    save_movie(stack.data, path, fps=fps, white=white)


def _bytes(frames: Array, white: float | None) -> np.ndarray:
    """Frames (n, y, x[, 3]) as uint8, one scale for all."""
    checks.array("frames", frames, FormatError)
    data = to_numpy(frames)
    if data.ndim not in (3, 4) or data.shape[3:] not in ((), (1,), (3,)) or data.size == 0:
        raise FormatError(f"a film needs frames (n, y, x) or (n, y, x, 3) but they have shape {data.shape}.")
    data = data[..., 0] if data.shape[3:] == (1,) else data
    if data.dtype == np.uint8:
        return data
    if data.dtype.kind == "u":
        data = data.astype(np.float32) / np.float32(np.iinfo(data.dtype).max)
        white = 1.0 if white is None else white
    checks.finite_array("frames", data, FormatError)
    white = (float(data.max()) or 1.0) if white is None else white
    return np.stack([to_integers(frame, white=white if white > 0 else 1.0, bits=8) for frame in data])


def _save_gif(pictures: np.ndarray, path: Path, fps: float) -> None:
    # One palette for all frames, so that colours do not flicker: quantised from a few frames side by side.
    images = [Image.fromarray(picture) for picture in pictures]
    if pictures.ndim == 4:
        chosen = pictures[:: max(1, len(pictures) // 4)][:, :: max(1, pictures.shape[1] // 256)]
        sample = Image.fromarray(np.concatenate(list(chosen)))
        palette = sample.quantize(256, method=Image.Quantize.MEDIANCUT)
        images = [image.quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG) for image in images]
    buffer, milliseconds = io.BytesIO(), max(10, round(100 / fps) * 10)  # a GIF counts hundredths
    images[0].save(
        buffer, "GIF", save_all=True, append_images=images[1:], duration=milliseconds, loop=0, disposal=1
    )
    target.write_bytes(path, buffer.getvalue())


def _save_mp4(pictures: np.ndarray, path: Path, fps: float) -> None:
    try:
        import av
    except ImportError as error:
        raise FormatError(
            "MP4 films need the package av: pip install 'lumigraph[video]'. Or write a .gif."
        ) from error
    with target.replacing(path) as temporary:
        # H.264 with 4:2:0 colours needs even sides: the last row and column are repeated.
        rows, columns = (n + n % 2 for n in pictures.shape[1:3])
        with av.open(str(temporary), "w", format="mp4") as film:
            stream = film.add_stream("libx264", rate=Fraction(fps).limit_denominator(1001))
            stream.width, stream.height, stream.pix_fmt = columns, rows, "yuv420p"
            stream.options = {"crf": "18"}
            for picture in pictures:
                grey = picture if picture.ndim == 3 else np.repeat(picture[..., None], 3, -1)
                pad = ((0, rows - grey.shape[0]), (0, columns - grey.shape[1]), (0, 0))
                frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(np.pad(grey, pad, "edge")), "rgb24")
                film.mux(stream.encode(frame))
            film.mux(stream.encode())
