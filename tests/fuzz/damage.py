"""Damages of a run of bytes: flipped, cut, moved, repeated, numbers replaced by others."""

import numpy as np

# Whole numbers that lengths, counts and offsets are replaced by, and texts that numbers are.
NUMBERS = (
    0,
    1,
    2,
    7,
    0x7F,
    0x80,
    0xFF,
    0x100,
    0x7FFF,
    0xFFFF,
    0x10000,
    1 << 20,
    1 << 24,
    10**9,
    2**31 - 1,
    2**31,
    2**32 - 1,
)
TEXTS = (
    b"0",
    b"-1",
    b"1e9",
    b"999999999",
    b"1e308",
    b"nan",
    b"null",
    b"[]",
    b"{}",
    b'""',
    b"65536",
    b"0.5",
    b"true",
    b"[[",
    b"&x;",
)


def _place(content: bytearray, rng: np.random.Generator) -> int:
    """Half of the places lie in the first 300 bytes, where headers stand."""
    near = min(len(content), 300) if rng.random() < 0.5 else len(content)
    return int(rng.integers(max(near, 1)))


def flip(content: bytearray, rng: np.random.Generator) -> bytearray:
    if content:
        content[_place(content, rng)] ^= 1 << int(rng.integers(8))
    return content


def number(content: bytearray, rng: np.random.Generator) -> bytearray:
    size, order = int(rng.choice((1, 2, 4, 8))), ("little", "big")[rng.integers(2)]
    value = NUMBERS[rng.integers(len(NUMBERS))] % 256**size
    at = _place(content, rng)
    content[at : at + size] = value.to_bytes(size, order)
    return content


def text(content: bytearray, rng: np.random.Generator) -> bytearray:
    """A run of digits, as in JSON, XML and headers of text, becomes something else."""
    at = _place(content, rng)
    start = next((k for k in range(at, min(len(content), at + 200)) if 48 <= content[k] < 58), at)
    stop = start
    while stop < len(content) and (48 <= content[stop] < 58 or content[stop] in b".-+e"):
        stop += 1
    content[start:stop] = TEXTS[rng.integers(len(TEXTS))]
    return content


def noise(content: bytearray, rng: np.random.Generator) -> bytearray:
    at, size = _place(content, rng), int(rng.integers(1, 16))
    content[at : at + size] = rng.bytes(size)
    return content


def cut(content: bytearray, rng: np.random.Generator) -> bytearray:
    return content[: int(rng.integers(len(content) + 1))]


def remove(content: bytearray, rng: np.random.Generator) -> bytearray:
    at = _place(content, rng)
    del content[at : at + int(rng.integers(1, 64))]
    return content


def repeat(content: bytearray, rng: np.random.Generator) -> bytearray:
    at, size = _place(content, rng), int(rng.integers(1, 64))
    content[at:at] = content[at : at + size] * int(rng.choice((1, 2, 50)))
    return content


def move(content: bytearray, rng: np.random.Generator) -> bytearray:
    here, there, size = _place(content, rng), _place(content, rng), int(rng.integers(1, 32))
    content[here : here + size] = content[there : there + size]
    return content


DAMAGES = (flip, flip, number, number, number, text, text, noise, cut, remove, repeat, move)
