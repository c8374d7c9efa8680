"""Arrays in NumPy's `.npz`, read so that a small file cannot fill the memory."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping

import numpy as np


def stored_bytes(arrays: Mapping[str, np.ndarray]) -> bytes:
    """An archive of arrays, not compressed."""
    file = io.BytesIO()
    np.savez(file, **arrays)  # pyright: ignore[reportArgumentType] - names are those of arrays
    return file.getvalue()


def stored_arrays(content: bytes) -> dict[str, np.ndarray]:
    """The arrays of an archive that `stored_bytes` made.

    Raises:
        ValueError: Its arrays are compressed. A broken archive raises whatever zipfile and NumPy raise.
    """
    with zipfile.ZipFile(io.BytesIO(content)) as members:
        if any(each.file_size != each.compress_size for each in members.infolist()):
            raise ValueError("its arrays are compressed: a small file could fill the memory")
    with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
        return {name: arrays[name] for name in arrays.files}
