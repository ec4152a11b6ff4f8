"""Pieces of work for the tests of batches: worker processes import them."""

import os
import signal
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from lumigraph import cluster


def picture(item):
    """Noise by the item's seed; a line in a file of each time that it was made."""
    if "log" in item:
        with Path(item["log"]).open("a") as file:
            file.write(f"{item['seed']}\n")
    time.sleep(item.get("pause", 0))
    if item.get("bad"):
        raise ValueError("this one is bad")
    if item.get("deadly") and not Path(item["deadly"]).exists():
        Path(item["deadly"]).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    if item.get("always_deadly"):
        os.kill(os.getpid(), signal.SIGKILL)
    return {"a": np.random.default_rng(item["seed"]).random((3, 40, 50), np.float32), "b": np.arange(4)}


def row(item):
    """Two numbers."""
    return cluster.Values({"seed": item["seed"], "square": item["seed"] ** 2})


def spinning(item):
    """Work for so many seconds of a processor."""
    began = time.process_time()
    while time.process_time() - began < item["busy"]:
        pass
    return cluster.Values(item)


class Here:
    """Works in this process."""

    is_here, count = True, 1

    @contextmanager
    def group(self, task):
        self.task = task
        yield self

    def each(self, numbers):
        yield from self.task.do(numbers)


class Together:
    """Noise as `picture` gives it, up to three at a time; how many there were is a line in a file."""

    side_by_side = 3

    def __call__(self, item):
        raise AssertionError("never one alone")

    def several(self, items):
        with Path(items[0]["groups"]).open("a") as file:
            file.write(f"{len(items)}\n")
        if any(item.get("spoils") for item in items):
            raise ValueError("all of it is bad")
        yield [_tried(item) for item in items[:2]]
        if items[2:]:
            yield [_tried(item) for item in items[2:]]


def _tried(item):
    try:
        return picture(item)
    except ValueError as error:
        return error
