"""Size and order of the source: code lines, files, names, docstrings, derivatives by hand, files loaded.

    python -m benchmarks.house

prints one line for each figure. Code lines leave docstrings, comments and blank lines out.
"""

import ast
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import lumigraph

ROOT = Path(lumigraph.__file__).parent
Documented = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef

WITHOUT_SUBJECT = re.compile(r"(Of|That|Those|By|As|At|To|From|With|In|On|For|What|Its|Their)(?![\w-])")
BY_HAND = re.compile(r"(_?(changed|back|turned|_back|gradient|slopes?|by_pairs|adjoint_of\w*))$")
"""Names of methods that propagate derivatives by hand in `operators`."""

CAMERA = """
import sys, time
import lumigraph as lg
lg.load_camera("thesis-plenoptic-1")
print(sum(name.partition(".")[0] == "lumigraph" for name in sys.modules), time.process_time())
"""


def modules(room: str = "") -> Iterator[tuple[Path, ast.Module]]:
    """Each source file below a room, with its syntax tree."""
    for path in sorted((ROOT / room).rglob("*.py")):
        yield path, ast.parse(path.read_text(encoding="utf-8"))


def code_lines(path: Path, tree: ast.Module) -> set[int]:
    """Numbers of the lines that hold code."""
    prose: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, Documented) and ast.get_docstring(node) is not None:
            prose.update(range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1))
    lines = path.read_text(encoding="utf-8").splitlines()
    return {
        number
        for number, line in enumerate(lines, 1)
        if number not in prose and line.strip() and not line.lstrip().startswith("#")
    }


def size(room: str = "") -> tuple[int, int, int]:
    """Code lines of a room, its files, and the most files in one of its folders."""
    found = list(modules(room))
    folders = Counter(path.parent for path, _ in found)
    return sum(len(code_lines(*one)) for one in found), len(found), max(folders.values())


def by_hand() -> int:
    """Code lines of methods of `operators` that carry derivatives forwards or back."""
    count = 0
    for path, tree in modules("operators"):
        lines = code_lines(path, tree)
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef) and BY_HAND.match(node.name):
                count += len(lines & set(range(node.lineno, (node.end_lineno or 0) + 1)))
    return count


def classes() -> Counter[str]:
    """Number of files in which each class name is defined."""
    return Counter(
        name
        for _, tree in modules()
        for name in {node.name for node in ast.walk(tree) if isinstance(node, ast.ClassDef)}
    )


def without_subject() -> int:
    """Docstrings of classes and functions whose first line has no subject."""
    texts = (
        ast.get_docstring(node)
        for _, tree in modules()
        for node in ast.walk(tree)
        if isinstance(node, Documented) and not isinstance(node, ast.Module)
    )
    return sum(bool(text and WITHOUT_SUBJECT.match(text)) for text in texts)


def contracts() -> str:
    """Result of import-linter: floors, circles and homes of libraries."""
    linter = Path(sys.executable).with_name("lint-imports")
    out = subprocess.run([linter, "--no-cache"], capture_output=True, text=True, check=False).stdout
    return next((line for line in out.splitlines() if line.startswith("Contracts:")), "not found")


def loaded() -> tuple[int, float]:
    """Files that `load_camera` loads in a process of its own, and its processor time [s]."""
    out = subprocess.run([sys.executable, "-c", CAMERA], capture_output=True, text=True, check=True).stdout
    files, seconds = out.split()
    return int(files), float(seconds)


def main() -> None:
    lines, files, _ = size()
    operators, _, most = size("operators")
    names = classes()
    cameras, seconds = loaded()
    print(f"code lines, src                             {lines} in {files} files")
    print(f"operators: code lines; files in one folder  {operators}; {most}")
    print(f"operators: derivatives by hand, code lines  {by_hand()}")
    print(f"classes; names in two files or more         {sum(names.values())}; "
          f"{sum(count > 1 for count in names.values())}")  # fmt: skip
    print(f"docstrings without a subject                {without_subject()}")
    print(f"import floors and circles                   {contracts()}")
    print(f"load_camera: files; CPU s                   {cameras}; {seconds:.2f}")


if __name__ == "__main__":
    main()
