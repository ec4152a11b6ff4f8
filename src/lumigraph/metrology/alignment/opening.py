"""Benches opened from their files."""

from os import PathLike

from lumigraph.errors import FormatError
from lumigraph.instruments import Instrument
from lumigraph.metrology.alignment.devices import Bench
from lumigraph.metrology.alignment.setup import BenchSetup, read_setup
from lumigraph.metrology.alignment.simulated import simulated


def open_bench(setup: BenchSetup | str | PathLike[str], camera: Instrument) -> Bench:
    """Bench of a file: Micro-Manager's devices of its `config`, or simulated ones that show `camera`.

    Raises
    ------
    FormatError
        The file is not one of a bench, or pymmcore-plus is missing.
    BenchError
        A device that there is not.
    """
    setup = setup if isinstance(setup, BenchSetup) else read_setup(setup)
    try:
        from lumigraph.metrology.alignment import unicore
    except ImportError as error:
        raise FormatError(
            f"benches need pymmcore-plus, which is missing ({error}). Install it: "
            "pip install 'lumigraph[bench]'."
        ) from None
    if setup.simulated is None:
        return unicore.loaded(setup)
    return unicore.simulated_devices(setup, simulated(setup, camera))
