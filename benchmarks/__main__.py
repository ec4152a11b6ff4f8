"""The benchmarks of speed against plain SciPy, one after the other; then what else can be run, and how."""

import ast
import importlib
from pathlib import Path

SPEED = {"two_f_snapshots": {}, "plenoptic_snapshots": {}, "periodic_operator": {"only": ("speed",)}}
"""What `make bench` runs; the others need data, a browser, a GPU or an hour."""


def main() -> None:
    for name, options in SPEED.items():
        benchmark = importlib.import_module(f"benchmarks.{name}")
        print(f"\n{name}: {(benchmark.__doc__ or '').splitlines()[0]}")
        benchmark.show(benchmark.run(**options))
    print("\nOthers:")
    for path in sorted(Path(__file__).parent.glob("[a-z]*.py")):
        text = path.read_text(encoding="utf-8")
        if path.stem not in SPEED and "if __name__ ==" in text:
            about = (ast.get_docstring(ast.parse(text)) or "").splitlines()[0]
            print(f"  python -m benchmarks.{path.stem}: {about}")


if __name__ == "__main__":
    main()
