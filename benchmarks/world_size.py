"""What a step costs in worlds of different sizes: what its rays cost, not what the world costs.

The same two robots with the same sensor, whose rays end after 2.5 m and so do the same work in any world;
the pooled overview of the belief is observed, which must not be worked out anew in each step either.
"""

from __future__ import annotations

import math

import numpy as np

from benchmarks.rows import Effort, Goal, Row, Taken, compared, interleave, timed
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.scenario import Scenario, with_settings
from entropy_explore_env.scenarios import ROOM
from entropy_explore_env.settings import Ending, Grid

SHAPES = ((41, 41, 17), (200, 200, 25), (500, 500, 40), (1000, 1000, 100))
"""2.9·10⁴, 10⁶, 10⁷ and 10⁸ voxels."""
QUICK_SHAPES = SHAPES[:3]
_ROBOTS = 2
_STEPS = 300
_FULL_SCANS = 300
"""An effort of so many scans or more measures the largest world, too: it takes 5 GiB."""


def sized(shape: tuple[int, int, int]) -> Scenario:
    """An empty world of this shape for two robots."""
    return with_settings(
        ROOM,
        {
            "grid": Grid(shape, ROOM.grid.voxel_size_m),
            "robots": _ROBOTS,
            "decision_period_s": None,
            "sensor": {"max_range_m": 2.5},
            "channel": {"i_min_bits": 0.0},
            "ending": Ending(sigma_end=1e-3, time_limit_s=math.inf),
            "observation": {"overview": True},
        },
    )


class Walk:
    """One ParallelEnv in a world of some size, stepped with the same random actions."""

    def __init__(self, shape: tuple[int, int, int]) -> None:
        """Make and reset the environment; a few steps touch the memory around the robots."""
        self.env = EntropyExploreEnv(sized(shape))
        self.env.reset(seed=0)
        rng = np.random.default_rng(0)
        boxes = rng.uniform(-1.0, 1.0, (_STEPS, _ROBOTS, 5)).astype(np.float32)
        self._actions = [dict(zip(self.env.possible_agents, row, strict=True)) for row in boxes]
        self.run(0)

    def run(self, _round: int) -> Taken:
        """What the steps take."""

        def advance() -> None:
            for action in self._actions:
                self.env.step(action)

        return timed(advance)


def size_rows(effort: Effort) -> list[Row]:
    """Microseconds a step in larger worlds, beside those in the room."""
    shapes = SHAPES if effort.scans >= _FULL_SCANS else QUICK_SHAPES
    walks = {shape: Walk(shape) for shape in shapes}
    taken = interleave({str(shape): walk.run for shape, walk in walks.items()}, effort.rounds)
    step_us = {name: [1e6 * t.cpu_s / _STEPS for t in rounds] for name, rounds in taken.items()}
    room = step_us[str(shapes[0])]
    return [
        compared(
            f"ParallelEnv.step, 2 robots, overview on, {math.prod(shape):.0e} voxels",
            f"{math.prod(shapes[0]):,} voxels",
            step_us[str(shape)],
            room,
            "µs",
            Goal("≤", 1.5),
        )
        for shape in shapes[1:]
    ]
