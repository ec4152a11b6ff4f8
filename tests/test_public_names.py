"""Names that docs/reference/api.md lists: each is there in a process that has imported nothing else."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import lumigraph as lg

PAGE = (Path(__file__).parents[1] / "docs" / "reference" / "api.md").read_text()
BEFORE, _, AFTER = PAGE.partition("Modules\n-------")
NOUNS_AND_VERBS, MODULES = (re.findall(r"^   (\w+)$", text, re.M) for text in (BEFORE, AFTER))

# What is slow and not ours is imported once; each child then imports lumigraph for itself.
FORKS = """
import json, os, sys
import numpy, scipy.fft, scipy.ndimage, scipy.optimize, pydantic, matplotlib.figure
failed = {}
for name in json.loads(sys.argv[1]):
    reader, writer = os.pipe()
    if not (child := os.fork()):
        try:
            import lumigraph
            getattr(lumigraph, name)
            said = ""
        except BaseException as error:
            said = repr(error) or "failed"
        os.write(writer, said.encode()[:1000])
        os._exit(0)
    os.close(writer)
    said = os.read(reader, 1000).decode()
    os.close(reader)
    os.waitpid(child, 0)
    if said:
        failed[name] = said
print(json.dumps(failed))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are forked")
@pytest.mark.parametrize("names", [MODULES, pytest.param(NOUNS_AND_VERBS, marks=pytest.mark.long)])
def test_each_listed_name_is_there_in_a_process_of_its_own(names):
    assert len(names) > 20
    run = subprocess.run([sys.executable, "-c", FORKS, json.dumps(names)], capture_output=True, text=True)
    assert json.loads(run.stdout) == {}, run.stderr


def test_packages_show_what_they_hand_on_and_no_helper_modules():
    packages = {name: found for name in MODULES if hasattr(found := getattr(lg, name), "__path__")}
    assert len(packages) > 20
    assert not [name for name, found in packages.items() if sorted(dir(found)) != sorted(found.__all__)]
    assert not [(room, n) for room, found in packages.items() for n in dir(found) if not hasattr(found, n)]


def test_old_names_say_the_new_ones():
    with pytest.raises(AttributeError, match=r"lumigraph\.view is now called lumigraph\.sub_aperture"):
        lg.view


def test_a_module_named_after_a_verb_can_be_called():
    told = lg.design("thesis-plenoptic-2-m050").as_dict()
    assert told == lg.load_camera("thesis-plenoptic-2-m050").describe().as_dict()
    with pytest.raises(lg.GeometryError, match="Decode the raw image first"):
        lg.depth(lg.RawImage(np.ones((4, 4))))
