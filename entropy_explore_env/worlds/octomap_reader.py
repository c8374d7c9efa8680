"""Read an OctoMap file with octomap-python and write its voxels to standard output as .npy.

Run as a script in a process of its own, so that a broken file can only break that process. It
imports nothing of the package, to start fast.

Output: (X, Y, Z) int8: -1 unknown, 0 free, 1 occupied; before it a line of JSON with `voxel_size_m`
and `origin_m`. Exit code 3 with one line on standard error for a file that cannot be used.
"""

from __future__ import annotations

import json
import math
import sys
from typing import Any, NoReturn

MEMORY_BYTES = 4 << 30
MAX_NATIVE_VOXELS = 200_000_000
_REFUSED = 3


def refuse(reason: str) -> NoReturn:
    """Say why and stop."""
    print(reason, file=sys.stderr)
    raise SystemExit(_REFUSED)


def missing_bytes(path: str, tree: Any) -> int:  # noqa: ANN401 - octomap has no types
    """How much shorter the file is than its tree, two bytes an inner node; the reader would take zeros."""
    with open(path, "rb") as file:  # noqa: PTH123 - pathlib would be one more import to wait for
        _, _, body = file.read().partition(b"\ndata\n")
    return 2 * (tree.size() - tree.getNumLeafNodes()) - len(body)


def main(path: str) -> None:
    """Read the tree and write its voxels."""
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    except (ImportError, ValueError):  # not to be had on this system
        pass
    import numpy as np
    import octomap

    tree: Any = octomap.OcTree(1.0)
    if not tree.readBinary(path.encode()) or tree.size() == 0 or missing_bytes(path, tree) > 0:
        refuse("a whole OctoMap binary tree")
    edge = tree.getResolution()
    low, high = np.array(tree.getMetricMin()), np.array(tree.getMetricMax())
    extent = (high - low) / edge if edge > 0 else np.full(3, np.nan)
    if not np.isfinite(extent).all() or not (np.isfinite(low).all() and (extent >= 0.5).all()):
        refuse("an OctoMap with a resolution > 0 and finite bounds")
    if math.prod(extent.tolist()) > MAX_NATIVE_VOXELS:
        refuse(f"an OctoMap whose box holds at most {MAX_NATIVE_VOXELS} voxels")
    shape = np.rint(extent).astype(int)
    labels = np.empty(shape, np.int8)
    y, z = (low[a] + (np.arange(shape[a]) + 0.5) * edge for a in (1, 2))
    for i in range(shape[0]):
        x = low[0] + (i + 0.5) * edge
        slab = np.stack(np.meshgrid([x], y, z, indexing="ij"), axis=-1).reshape(-1, 3)
        labels[i] = tree.getLabels(slab).reshape(shape[1:])
    header = {"voxel_size_m": float(edge), "origin_m": [float(v) for v in low]}
    sys.stdout.buffer.write(json.dumps(header).encode() + b"\n")
    np.save(sys.stdout.buffer, labels, allow_pickle=False)
    sys.stdout.buffer.flush()


if __name__ == "__main__":
    main(sys.argv[1])
