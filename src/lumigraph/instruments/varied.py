"""`--vary`: keys of a camera file with several values each, and the cameras that have them."""

import itertools
import re
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

from lumigraph.errors import FormatError
from lumigraph.instruments.files import write
from lumigraph.instruments.instrument import Instrument
from lumigraph.units import spaced

MOST = 100_000
"""Combinations."""

NUMBER = re.compile(r"([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*(\D*)")
"""A value, and its unit if it has one."""


def values(text: str) -> tuple[str, list[Any]]:
    """A key of the camera file and the values after it: several, or a range as `units.spaced` reads it.

    >>> values("lenslets.focal_length=4 mm:6 mm:x3")
    ('lenslets.focal_length', ['4 mm', '5 mm', '6 mm'])
    >>> values("lenslets.layout=square, hex")[1], values("lenslets.magnification=0.3,0.5")[1]
    (['square', 'hex'], [0.3, 0.5])
    >>> values("lenslets.focal_length=4 mm:6 mm:x1")[1]
    ['5 mm']
    """
    name, equals, words = text.partition("=")
    parts = [word.strip() for word in words.split(":")]
    if not (equals and name.strip() and all(parts)):
        raise FormatError(f"--vary is {text!r} but must be like 'lenslets.focal_length=4 mm:6 mm:x9'.")
    if len(parts) == 1:
        return name.strip(), [_number(word.strip()) for word in words.split(",")]
    numbers, unit = spaced(words, f"--vary {name.strip()}", MOST)
    return name.strip(), [
        f"{number:.10g} {unit}" if unit else _number(f"{number:.10g}") for number in numbers
    ]


def _number(word: str) -> Any:
    for kind in (int, float):
        try:
            return kind(word)
        except ValueError:
            continue
    return word


def combinations(varied: Mapping[str, list[Any]]) -> list[dict[str, Any]]:
    """Every combination of the values of some keys."""
    count = 1
    for some in varied.values():
        count *= len(some)
    if count > MOST:
        raise FormatError(f"--vary asks for {count} combinations; at most {MOST} are taken.")
    return [dict(zip(varied, one, strict=True)) for one in itertools.product(*varied.values())]


def changed(camera: Instrument, item: Mapping[str, Any]) -> Instrument:
    """The camera whose file has other values, by dotted keys; lengths carry a unit as in the file.

    A part of a key is one of a table, a number that counts a list's values from 0, or several with commas
    between them, which all get the value: ``lenslets.single.2,8.focal_change``. A list that the file leaves
    out begins as the camera has it: ``built.array_tilt.0``.
    """
    table = tomllib.loads(camera.to_toml())
    for name, value in item.items():
        *path, last = ([one.strip() for one in part.split(",")] for part in name.split("."))
        places: list[Any] = [table]
        for before, keys in enumerate(path):
            begun = {key: _begun(camera, [*(one for (one, *_) in path[:before]), key]) for key in keys}
            places = [_inside(place, key, name, begun[key]) for place in places for key in keys]
        for place, key in itertools.product(places, last):
            place[_key(place, key, name)] = value
    return type(camera).from_table(table, "--vary")


def value(camera: Instrument, name: str) -> Any:
    """Value under a key of `changed` in the camera's file; None if there is none, or several."""
    *path, last = ([one.strip() for one in part.split(",")] for part in name.split("."))
    places: list[Any] = [tomllib.loads(camera.to_toml())]
    for keys in (*path, last):
        places = [_under(place, key) for place in places for key in keys]
    return places[0] if all(one == places[0] for one in places) else None


def _under(place: Any, key: str) -> Any:
    if isinstance(place, list):
        return place[int(key)] if key.isdecimal() and int(key) < len(place) else None
    return place.get(key) if isinstance(place, dict) else None


def _begun(camera: Instrument, keys: Sequence[str]) -> Any:
    """Default under keys that a file leaves out: the values of a list, or an empty table."""
    found: Any = camera
    for key in keys:
        found = getattr(found, key, None)
    return tomllib.loads(write({keys[-1]: found}))[keys[-1]] if isinstance(found, tuple) else {}


def _inside(place: Any, key: str, name: str, begun: Any) -> Any:
    """Table or list under a key; in a table without it, the default `begun`."""
    key = _key(place, key, name)
    found = place.setdefault(key, begun) if isinstance(place, dict) else place[key]
    if not isinstance(found, dict | list):
        raise FormatError(f"--vary {name}: {key} is a value, which has no parts. Check the key.")
    return found


def _key(place: Any, key: str, name: str) -> Any:
    """A key as its table or list has it."""
    if isinstance(place, dict):
        return key
    if not (key.isdecimal() and int(key) < len(place)):
        raise FormatError(f"--vary {name}: {key} is none of the values 0 to {len(place) - 1}. Check the key.")
    return int(key)
