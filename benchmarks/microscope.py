"""CPU seconds of a microscope's point images and Richardson-Lucy iterations, beside pyolaf where it is.

lfm-guv at 15 pixels and 5 samples per lenslet, -4 to 4 um in steps of 2 um. pyolaf (GPL) is run as a black
box in an environment of its own: PYOLAF names its interpreter, LUMIGRAPH_DATA the folder with lfm_guv.
"""

import json
import os
import subprocess
import time

import numpy as np

from lumigraph.deconvolution import deconvolve
from lumigraph.instruments import LightFieldMicroscope

DEPTHS = tuple(float(z) for z in np.arange(-4e-6, 4.1e-6, 2e-6))

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
camera = LFM_setCameraParams(file.name, 15)
white = tifffile.imread(os.path.join(sys.argv[1], "Radiometry_GUVExperim1.tif")).astype(float)
centers, resolution = LFM_computeGeometryParameters(camera, white, [-4.0, 4.0], 2.0, 5, False)[:2]
start = cpu()
forward, backward = LFM_computeLFMatrixOperators(camera, resolution, centers)[:2]
images = cpu() - start
shape, texture = np.array([425, 425]), np.array([143, 143])
light = lambda volume: LFM_forwardProject(forward, volume, centers, resolution, shape, camera["range"])
back = lambda raw: LFM_backwardProject(backward, raw, centers, resolution, texture, camera["range"])
volume = np.ones((143, 143, 5))
light(volume)
start = cpu()
for _ in range(3):
    volume = volume * np.nan_to_num(back(np.nan_to_num(np.ones((425, 425)) / light(volume))))
print(json.dumps({"images": images, "iteration": (cpu() - start) / 3}))
"""


def run() -> dict[str, dict[str, float]]:
    """Seconds by program."""
    scope = LightFieldMicroscope.from_catalogue("lfm-guv").replace(objective={"model": "scalar"})
    start = time.process_time()
    operator = scope.operator(DEPTHS, 5, pixels=15, dropped=0.02)
    images = time.process_time() - start
    raw = operator.forward(np.ones(operator.shape[1], np.float32)) + 1
    deconvolve(raw, operator, 1)
    times = []
    deconvolve(raw, operator, 8, progress=lambda step: times.append(time.process_time()))
    found = {"lumigraph": {"images": images, "iteration": float(np.diff(times).min())}}
    python, data = os.environ.get("PYOLAF"), os.environ.get("LUMIGRAPH_DATA")
    if python and data:
        command = [python, "-c", BLACK_BOX, os.path.join(data, "lfm_guv")]  # noqa: PTH118
        told = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        found["pyolaf"] = json.loads(told.splitlines()[-1])
    return found


def show(found: dict[str, dict[str, float]]) -> None:
    for name, values in found.items():
        print(f"{name:10} point images {values['images']:6.2f} s   iteration {values['iteration']:7.3f} s")
    if "pyolaf" in found:
        ratios = {key: found["pyolaf"][key] / found["lumigraph"][key] for key in ("images", "iteration")}
        print(f"ratio      point images {ratios['images']:6.1f}     iteration {ratios['iteration']:7.1f}")
