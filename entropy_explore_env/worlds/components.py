"""Face-connected components of a mask: which voxels can be reached from each other without leaving it."""

from __future__ import annotations

from typing import cast

import numpy as np
from scipy import ndimage


def connected_components(mask: np.ndarray) -> tuple[np.ndarray, int]:
    """Label the face-connected components of a mask with numbers.

    Args:
        mask: (X, Y) or (X, Y, Z) bool.

    Returns:
        Labels, int32 of the mask's shape (0 = outside the mask, components count from 1), and the number of
        components.
    """
    return cast("tuple[np.ndarray, int]", ndimage.label(mask))


def largest_component(mask: np.ndarray) -> np.ndarray:
    """Return the largest face-connected component of a mask, as a mask; empty if the mask is empty."""
    labels, count = connected_components(mask)
    if count <= 1:
        return mask
    sizes = np.bincount(labels.ravel())
    sizes[0] = 0
    return labels == int(sizes.argmax())
