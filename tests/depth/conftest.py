"""Makes `scenes` importable: tests run with importlib mode."""

import importlib.util
import sys
from pathlib import Path

_spec = importlib.util.spec_from_file_location("scenes", Path(__file__).with_name("scenes.py"))
assert _spec is not None
assert _spec.loader is not None
_module = importlib.util.module_from_spec(_spec)
sys.modules.setdefault("scenes", _module)
_spec.loader.exec_module(_module)
