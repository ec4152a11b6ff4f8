"""CPU seconds of a microscope's point images and Richardson-Lucy iterations, beside pyolaf where it is.

lfm-guv at 15 pixels and 5 samples per lenslet, -4 to 4 um in steps of 2 um; with SLICES=13, -6 to 6 um in
steps of 1 um. Iterations are medians; point images include the matrices of their frequencies. pyolaf is
run as a black box in an environment of its own: PYOLAF names its interpreter, LUMIGRAPH_DATA the folder with
lfm_guv.
"""

import json
import os
import subprocess
import time

import numpy as np

from lumigraph.deconvolution import deconvolve
from lumigraph.instruments import LightFieldMicroscope

SLICES = int(os.environ.get("SLICES", "5"))
FARTHEST, STEP = (6.0, 1.0) if SLICES == 13 else (4.0, 2.0)
DEPTHS = tuple(float(z) * 1e-6 for z in np.arange(-FARTHEST, FARTHEST + 0.1, STEP))

BLACK_BOX = """
import json, os, resource, sys, tempfile, warnings
import numpy as np, tifffile, yaml
from pyolaf.geometry import LFM_computeGeometryParameters, LFM_setCameraParams
from pyolaf.lf import LFM_computeLFMatrixOperators
from pyolaf.project import LFM_backwardProject, LFM_forwardProject
warnings.filterwarnings("ignore")
def cpu():
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in used)
scope = dict(gridType="reg", focus="single", plenoptic=1, uLensMask=1, M=60.0, NA=1.2, ftl=200000.0,
             fm=2500.0, lensPitch=100.0, pixelPitch=6.5, n=1.35, WaveLength=0.593, mla2sensor=2500.0,
             tube2mla=0, spacingPx=15.38)
with tempfile.NamedTemporaryFile("w", suffix=".yaml", delete=False) as file:
    yaml.safe_dump(scope, file)
far, step = float(sys.argv[2]), float(sys.argv[3])
camera = LFM_setCameraParams(file.name, 15)
white = tifffile.imread(os.path.join(sys.argv[1], "Radiometry_GUVExperim1.tif")).astype(float)
centers, resolution = LFM_computeGeometryParameters(camera, white, [-far, far], step, 5, False)[:2]
start = cpu()
forward, backward = LFM_computeLFMatrixOperators(camera, resolution, centers)[:2]
images = cpu() - start
shape, texture = np.array([425, 425]), np.array([143, 143])
light = lambda volume: LFM_forwardProject(forward, volume, centers, resolution, shape, camera["range"])
back = lambda raw: LFM_backwardProject(backward, raw, centers, resolution, texture, camera["range"])
volume = np.ones((143, 143, round(2 * far / step) + 1))
light(volume)
times = [cpu()]
for _ in range(3):
    volume = volume * np.nan_to_num(back(np.nan_to_num(np.ones((425, 425)) / light(volume))))
    times.append(cpu())
print(json.dumps({"images": images, "iteration": float(np.median(np.diff(times)))}))
"""


def run() -> dict[str, dict[str, float]]:
    """Seconds by program; point images are computed, whatever the cache folder holds."""
    os.environ["LUMIGRAPH_CACHE"] = "off"
    scope = LightFieldMicroscope.from_catalogue("lfm-guv").replace(objective={"model": "scalar"})
    start = time.process_time()
    operator = scope.operator(DEPTHS, 5, pixels=15, accuracy=1e-2)
    raw = operator.forward(np.ones(operator.shape[1], np.float32)) + 1
    images = time.process_time() - start
    deconvolve(raw, operator, 1)
    times = []
    deconvolve(raw, operator, 16, progress=lambda step: times.append(time.process_time()))
    found = {"lumigraph": {"images": images, "iteration": float(np.median(np.diff(times)))}}
    python, data = os.environ.get("PYOLAF"), os.environ.get("LUMIGRAPH_DATA")
    if python and data:
        command = [python, "-c", BLACK_BOX, f"{data}/lfm_guv", str(FARTHEST), str(STEP)]
        told = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        found["pyolaf"] = json.loads(told.splitlines()[-1])
    return found


def show(found: dict[str, dict[str, float]]) -> None:
    for name, values in found.items():
        print(f"{name:10} point images {values['images']:6.2f} s   iteration {values['iteration']:7.3f} s")
    if "pyolaf" in found:
        ratios = {key: found["pyolaf"][key] / found["lumigraph"][key] for key in ("images", "iteration")}
        print(f"ratio      point images {ratios['images']:6.1f}     iteration {ratios['iteration']:7.1f}")


if __name__ == "__main__":
    show(run())
