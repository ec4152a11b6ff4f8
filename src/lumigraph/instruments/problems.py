"""Pydantic's findings as one-line errors: the dotted field, the value, the remedy."""

from difflib import get_close_matches
from typing import Any, get_args, get_origin

from pydantic import BaseModel, ValidationError

from lumigraph.errors import FormatError, GeometryError, LumigraphError

# A misspelt key is also a missing one: say the former.
_FIRST = ("extra_forbidden", "missing")


def readable(error: ValidationError, model: type[BaseModel]) -> LumigraphError:
    """The first problem as a `GeometryError` (a value) or `FormatError` (a key, a unit, a type)."""
    problems = error.errors(include_url=False)
    rank = {kind: place for place, kind in enumerate(_FIRST)}
    problem = min(problems, key=lambda each: rank.get(each["type"], len(_FIRST)))
    where = tuple(str(part) for part in problem["loc"])
    name, kind, value = ".".join(where), problem["type"], problem["input"]
    if kind == "extra_forbidden":
        return FormatError(unknown_key(name, _keys(model, where[:-1])))
    if kind == "missing":
        return FormatError(f"{name} is missing. Give it a value.")
    ours = problem.get("ctx", {}).get("error")
    if isinstance(ours, LumigraphError):
        return type(ours)(f"{name}: {ours}" if name else str(ours))
    if kind == "literal_error":
        return GeometryError(f"{name}: {value!r} is not {problem.get('ctx', {}).get('expected')}.")
    if kind == "model_type":
        return FormatError(f"{name}: {value!r} is not a table of keys and values.")
    return GeometryError(
        f"{name}: {value!r} is not possible: {problem['msg'][:1].lower()}{problem['msg'][1:]}."
    )


def unknown_key(name: str, known: list[str]) -> str:
    """One line about a key that nothing reads, with the nearest known one."""
    *table, key = name.split(".")
    near = get_close_matches(key.replace("-", "_").lower(), known, 1, 0.5)
    if near:
        return f"{name} is not a known key. Did you mean {'.'.join([*table, near[0]])!r}?"
    return f"{name} is not a known key. Known here: {', '.join(known)}."


def _keys(model: type[BaseModel], where: tuple[str, ...]) -> list[str]:
    """Keys that the table at `where` may have."""
    current: Any = model
    for part in where:
        if get_origin(current) is dict:  # of parts, by keys that are free
            current = get_args(current)[1]
            continue
        fields = {field.alias or name: field for name, field in current.model_fields.items()}
        current = _table(fields[part].annotation)
    return [field.alias or name for name, field in current.model_fields.items()]


def _table(annotation: Any) -> Any:
    """The part, or the dict of parts, that a key holds: also one that may be left out (``Angles | None``)."""
    parts = (part for part in get_args(annotation) if part is not type(None))
    return next(parts) if type(None) in get_args(annotation) else annotation
