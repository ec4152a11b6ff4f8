"""State of a deconvolution in a file, from which an interrupted run resumes."""

import hashlib
import os
import time
import warnings
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lumigraph import store
from lumigraph.core import arrays, checks
from lumigraph.core.arrays import Array
from lumigraph.deconvolution.methods import State
from lumigraph.deconvolution.problem import Problem
from lumigraph.errors import FormatError

_PREFIX = "memory."
_SAME = 1e-4
"""Sensitivities of one operator differ by less: sums run in another order on another machine."""


@dataclass(slots=True)
class Checkpoint:
    """A file (.npz) that is written now and then, and read at the start if it is there.

    It holds the estimate, what the method remembers, and a digest of the raw image and the settings; the
    number of iterations is not among them, so that a finished run can be continued. Written atomically.

    Parameters
    ----------
    path
        Of the file.
    every
        Time between two writings [s]; 0 writes after every iteration.
    """

    path: Path
    every: float = 20.0
    _written: float = 0.0

    def __post_init__(self) -> None:
        self.path = Path(self.path)
        if self.path.suffix != ".npz":
            raise FormatError(f"the checkpoint {self.path} must end in .npz.")
        if checks.finite("every", self.every, "s") < 0:
            raise FormatError(f"every is {self.every:g} s but must be at least 0.")
        self._written = time.monotonic()

    @classmethod
    def of(cls, place: "Checkpoint | str | os.PathLike[str]") -> "Checkpoint":
        """Checkpoint at a path, or the given one."""
        if isinstance(place, Checkpoint):
            return place
        if not isinstance(place, str | os.PathLike):
            raise FormatError(
                f"checkpoint is of type {type(place).__name__} but must be a path or Checkpoint."
            )
        return cls(Path(place))

    def keep(self, problem: Problem, state: State, key: str, *, now: bool = False) -> None:
        """Write the state if it is time to, or `now`; on a full disk the run continues with a warning."""
        if not now and time.monotonic() - self._written < self.every:
            return
        content = {f"{_PREFIX}{name}": arrays.to_numpy(array) for name, array in state.memory.items()}
        content |= {"estimate": arrays.to_numpy(state.estimate), "done": np.asarray(state.done)}
        content |= {"key": np.asarray(key), "sensitivity": _trace(problem)}
        try:
            store.write(self.path, content)
        except FormatError as error:
            warnings.warn(f"the checkpoint {error}", RuntimeWarning, stacklevel=2)
        self._written = time.monotonic()

    def found(self, problem: Problem, key: str) -> State | None:
        """The state in the file; None where there is no file, or, with a warning, a damaged one.

        Raises
        ------
        FormatError
            No checkpoint, or one of another raw image, camera or method.
        """
        if not self.path.exists():
            return None
        content = _read(self.path)
        if content is None:
            return None
        like, shape = problem.data, tuple(problem.scale.sensitivity.shape)
        trace = content["sensitivity"]
        mine = _trace(problem)
        seen = np.isfinite(mine)
        same = trace.shape == mine.shape and np.allclose(
            trace[seen], mine[seen], rtol=_SAME, atol=_SAME * mine[seen].max(initial=0)
        )
        if str(content["key"]) != key or not same or content["estimate"].shape != shape:
            what = "raw image or settings" if same else "camera or grid"
            raise FormatError(
                f"the checkpoint {self.path} belongs to another {what}. Remove it, or give another name."
            )
        memory = {name[len(_PREFIX) :]: v for name, v in content.items() if name.startswith(_PREFIX)}
        return State.at(
            problem,
            arrays.like(content["estimate"], like),
            {name: arrays.like(value, like) for name, value in memory.items()},
            int(content["done"]),
        )


def fingerprint(*things: Any) -> str:
    """Digest of arrays, dataclasses of them and plain values, by content.

    Examples
    --------
    >>> fingerprint(np.ones(3)) == fingerprint(np.ones(3))
    True
    >>> fingerprint(np.ones(3)) == fingerprint(np.ones(3, np.float32))
    False
    """
    digest = hashlib.sha256()
    _absorb(digest, things)
    return digest.hexdigest()


def _absorb(digest: Any, thing: Any) -> None:
    if is_dataclass(thing) and not isinstance(thing, type):
        digest.update(type(thing).__qualname__.encode())
        for item in fields(thing):
            digest.update(item.name.encode())
            _absorb(digest, getattr(thing, item.name))
    elif isinstance(thing, tuple | list):
        digest.update(f"{len(thing)} of".encode())
        for item in thing:
            _absorb(digest, item)
    elif hasattr(thing, "shape") and hasattr(thing, "dtype"):
        values = np.ascontiguousarray(arrays.to_numpy(thing))
        digest.update(f"{values.dtype} {values.shape}".encode())
        digest.update(values.tobytes())
    elif callable(thing):  # its address in memory would differ in the next run
        digest.update(getattr(thing, "__qualname__", type(thing).__qualname__).encode())
    else:
        digest.update(repr(thing).encode())


def _trace(problem: Problem) -> np.ndarray:
    """Some of the sensitivity's values, which identify the operator."""
    values: Array = arrays.to_numpy(problem.scale.sensitivity).ravel()
    return values[:: max(1, values.size // 997)]


def _read(path: Path) -> dict[str, np.ndarray] | None:
    """Content of the file; None, with a warning, where it is a checkpoint that was damaged."""
    try:
        content = store.read(path)
    except store.DamagedError:
        warnings.warn(
            f"the checkpoint {path} is damaged: the run starts from the beginning, and writes it again.",
            RuntimeWarning,
            stacklevel=2,
        )
        return None
    except (FormatError, OSError) as error:
        raise FormatError(f"{path} is not a checkpoint of a deconvolution. Give another name.") from error
    if not _sound(content):
        raise FormatError(f"{path} is not a checkpoint of a deconvolution. Give another name.")
    return content


def _sound(content: dict[str, np.ndarray]) -> bool:
    """True if all that is needed is there, and of the right type: a seal proves no more than wholeness."""
    if not {"estimate", "done", "key", "sensitivity"} <= content.keys():
        return False
    done, numbers = content["done"], [value for name, value in content.items() if name not in ("done", "key")]
    if done.shape != () or done.dtype.kind not in "iu" or done < 0:
        return False
    return all(value.dtype.kind in "fiub" for value in numbers)
