"""What rules read off what a robot knows."""

import numpy as np

from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.frontiers.knowledge import voxel_of


def test_voxels_for_a_ground_robot_lie_in_its_layer_also_those_of_drones():
    env = EntropyExploreEnv("office-mixed", robots=4)
    env.reset(seed=1)
    grid, layers = env.scenario.grid, set()
    for agent in env.agents:
        view = env.view(agent)
        layer = view.scenario.layer_of(view.kind.robot)
        for height_m in np.arange(grid.shape[2]) * grid.voxel_size_m:
            voxel = voxel_of(view, np.array([3.0, 4.0, height_m + 0.01]))
            x, y, z = np.unravel_index(voxel, grid.shape)
            assert (x, y) == tuple(grid.voxel_of(np.array([3.0, 4.0, 0.0]))[:2])
            assert layer is None or z == layer
            layers.add((layer is None, int(z)))
    assert (True, 0) in layers and len({flies for flies, _ in layers}) == 2
