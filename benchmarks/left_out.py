"""Real corners of pictures that took no part: are they off by what `lg.metrology.Measured.locate` expects?

``python -m benchmarks.left_out FOLDER [--pictures 12]``: of a folder of COMPOTE's data, each picture is left
out in turn, the camera is measured by the others, and the board is found on the picture left out. It prints
the root mean square of what corners are off, what was expected, and their ratio.
"""

import argparse
import time
import warnings

import numpy as np

import lumigraph as lg


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder")
    parser.add_argument("--pictures", type=int)
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    corners, board, nominal = lg.metrology.load_compote(given.folder)
    started, ratios = time.process_time(), []
    frames = corners.frames[: given.pictures]
    for frame in frames.tolist():
        out = corners.frame == frame
        measured = lg.metrology.board(corners[~out], board, nominal)
        (pose,) = measured.locate(corners[out])
        ratios.append(pose.residual_px / pose.expected_px)
        print(
            f"picture {frame}: {int(out.sum())} places, {pose.residual_px:.3f} px, {pose.expected_px:.3f} px "
            f"expected, {ratios[-1]:.2f} times; f {measured.camera.focal_length * 1e3:.2f} mm",
            flush=True,
        )
    ratios = np.array(ratios)
    cost = (time.process_time() - started) / len(frames)
    print(
        f"rms ratio {np.sqrt((ratios**2).mean()):.2f}, {ratios.min():.2f} to {ratios.max():.2f} of "
        f"{len(ratios)}, {int((ratios < 1.1).sum())} below 1.1; {cost:.1f} CPU s each"
    )


if __name__ == "__main__":
    main()
