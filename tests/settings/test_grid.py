"""Points and voxels of a workspace."""

import numpy as np

from entropy_explore_env.settings.grid import Grid


def test_points_and_voxels():
    grid = Grid((7, 11, 5), 0.25, (-1.0, 2.0, 0.5))
    assert grid.centre_of(np.array([[0, 0, 0], [6, 10, 4]])).tolist() == [
        [-0.875, 2.125, 0.625],
        [0.625, 4.625, 1.625],
    ]
    assert grid.voxel_of(np.array([0.6, 4.7, 1.5])).tolist() == [6, 10, 4]
    assert grid.voxel_of(np.array([-1.01, 2.0, 0.5])).tolist() == [-1, 0, 0]
    assert grid.size_m.tolist() == [1.75, 2.75, 1.25]
    assert not grid.flat
    assert Grid((7, 11, 1), 0.25).flat
    voxels = np.argwhere(np.ones(grid.shape))
    assert (grid.voxel_of(grid.centre_of(voxels)) == voxels).all()
