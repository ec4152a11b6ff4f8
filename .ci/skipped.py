"""Prints which tests were skipped and why; fails where they are those that CI installs something for."""

import re
import sys
from collections import Counter
from xml.etree import ElementTree

NEVER = {
    "crosscheck": "HCIPy and POPPY are in .ci/oracles.txt",
    "pymmcore-plus is not installed": "pymmcore-plus is in .ci/oracles.txt",
    "no Chromium here": "chromium comes from the system's packages",
    "playwright is not installed": "playwright is in requirements-dev.lock",
}


def skipped(report: str) -> list[tuple[str, str]]:
    """Name and reason of each skipped test of a JUnit report."""
    found = []
    for case in ElementTree.parse(report).iter("testcase"):
        for skip in case.iter("skipped"):
            if skip.get("type") != "pytest.xfail":
                whole = re.search(r"Skipped: (.*)['\"]\)$", skip.text or "")
                reason = whole[1] if whole else skip.get("message", "")
                found.append((f"{case.get('classname')}.{case.get('name')}".strip("."), reason))
    return found


def main(report: str) -> None:
    """Print the reasons with their counts, then end with an error if a test had to run."""
    tests = skipped(report)
    for reason, count in Counter(reason for _, reason in tests).most_common():
        print(f"skipped {count}: {reason}")
    missed = [
        f"{name}: {reason}; {why}"
        for name, reason in tests
        for part, why in NEVER.items()
        if part in f"{name} {reason}"
    ]
    sys.exit("\n".join(["These tests must not be skipped:", *missed]) if missed else 0)


if __name__ == "__main__":
    main(sys.argv[1])
