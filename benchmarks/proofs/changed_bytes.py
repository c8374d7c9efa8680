"""Bytes of a file changed at random, whatever they mean."""

from __future__ import annotations

import numpy as np


def truncated(data: bytes, rng: np.random.Generator) -> bytes:
    """Cut off the end."""
    return data[: int(rng.integers(0, len(data)))]


def flipped(data: bytes, rng: np.random.Generator) -> bytes:
    """Flip one to eight bits."""
    changed = bytearray(data or b"0")
    for _ in range(int(rng.integers(1, 9))):
        changed[int(rng.integers(len(changed)))] ^= 1 << int(rng.integers(8))
    return bytes(changed)


def overwritten(data: bytes, rng: np.random.Generator) -> bytes:
    """Replace some bytes by noise."""
    start, length = int(rng.integers(len(data))), int(rng.integers(1, 65))
    return data[:start] + rng.bytes(length) + data[start + length :]


def doubled(data: bytes, rng: np.random.Generator) -> bytes:
    """Repeat a piece a few hundred times."""
    start = int(rng.integers(len(data)))
    piece = data[start : start + int(rng.integers(1, 200))]
    return data[:start] + piece * int(rng.integers(2, 400)) + data[start:]
