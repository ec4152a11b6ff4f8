"""A data set of `lumigraph dataset` in PyTorch: raw images, pictures and depths, read where they are needed.

First: lumigraph dataset thesis-plenoptic-1 -n 500 --depth "-60 mm:60 mm:20 mm" -o train.zarr
"""

import sys

import numpy as np
import torch  # pyright: ignore[reportMissingImports]
import zarr
from torch.utils.data import DataLoader, Dataset  # pyright: ignore[reportMissingImports]


class Drawn(Dataset):
    """Samples (raw, picture, depth) of a store; each is a file of its own, so workers read side by side."""

    def __init__(self, path: str) -> None:
        self.arrays = [zarr.open_array(path, path=name, mode="r") for name in ("raw", "picture", "depth")]

    def __len__(self) -> int:
        return self.arrays[0].shape[0]

    def __getitem__(self, number: int) -> list[torch.Tensor]:
        return [torch.from_numpy(np.asarray(array[number], np.float32)) for array in self.arrays]


def main(path: str = "train.zarr") -> None:
    for raw, picture, depth in DataLoader(Drawn(path), batch_size=4, shuffle=True):
        print("raw", *raw.shape, "picture", *picture.shape, f"depth {depth.min():.3g} to {depth.max():.3g} m")


if __name__ == "__main__":
    main(*sys.argv[1:])
