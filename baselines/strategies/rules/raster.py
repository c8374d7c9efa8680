"""Raster scanning (Sujan, sect. 3.1, method ii): places of a lattice, row by row, as they become known."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from baselines.strategies.next_best_view.known_space import KnownSpace, Memory
from entropy_explore_env.errors import SettingError
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.settings import RobotKind
from entropy_explore_env.validation import check_count, check_positive

_MOST_STEPS = 100_000


@dataclass(frozen=True)
class RasterConfig:
    """Where raster scans from.

    Attributes:
        spacing: Between its places, in sensor ranges; of a sensor without range limit, in tenths of the
            workspace's longest side.
        turning: Whether it looks in all directions from each place, or always along x.
        yaw_steps: In how many directions, evenly around; None = as few as show all around. More than one for
            each ray that would fit around are refused: a scan between two rays shows what these do.

    Raises:
        SettingError: The spacing is not > 0, or the steps are not a whole number ≥ 1.
    """

    spacing: float = 0.5
    turning: bool = True
    yaw_steps: int | None = None

    def __post_init__(self) -> None:
        """Check every field."""
        check_positive(self, "spacing")
        if self.yaw_steps is not None:
            check_count(self, "yaw_steps", 1, _MOST_STEPS)


class Raster(KnownSpace):
    """Scans from the places of a lattice, row by row, each as soon as it is known to be free."""

    def __init__(self, config: RasterConfig | None = None) -> None:
        """Take the settings; None = the defaults."""
        self.config = config or RasterConfig()

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """A new mission begins.

        Raises:
            SettingError: There are more yaw steps than rays around.
        """
        steps = self.config.yaw_steps
        for kind in scenario.kinds:
            around = max(round(2.0 * math.pi / kind.sensor.angular_step_rad), 1)
            if self.config.turning and steps is not None and steps > around:
                allowed = f"at most {around}, the rays around at RangeSensor.angular_step_rad apart"
                raise SettingError("RasterConfig.yaw_steps", steps, allowed)
        super().reset(scenario, rng)
        self._scans: dict[int, dict[int, int]] = {}
        """Robot → voxel → how many scans it has taken there."""

    def pick(self, view: RobotView, memory: Memory, reachable: np.ndarray) -> np.ndarray | None:
        """See `KnownSpace`."""
        taken, gazes = self._scans.setdefault(view.robot, {}), self._gazes(view.kind)
        last = list(taken)[-1:]  # all gazes of a place come first
        for voxel in [*last, *self._places(view.kind, reachable).tolist()]:
            done = taken.get(voxel, 0)
            if done < len(gazes):
                taken[voxel] = done + 1  # also where it is stopped on the way: then the next one
                return self.pose_in(view, voxel, gazes[done], 0.0)
        return None

    def _gazes(self, kind: RobotKind) -> list[float]:
        """Yaw of each scan from a place, radians."""
        wide = kind.sensor.field_of_view_rad[0]
        if not self.config.turning:
            return [0.0]
        turns = self.config.yaw_steps
        if turns is None:
            turns = math.ceil(2.0 * math.pi / wide - 1e-9) if wide > 0.0 else 1
        return [2.0 * math.pi * turn / turns for turn in range(turns)]

    def _places(self, kind: RobotKind, reachable: np.ndarray) -> np.ndarray:
        """Of the (N,) reachable voxels those of the lattice, in row order: along x, then y, then z."""
        grid = self._scenario.grid
        range_m = kind.sensor.max_range_m
        unit_m = 0.1 * max(grid.size_m) if math.isinf(range_m) else range_m
        step = max(round(self.config.spacing * unit_m / grid.voxel_size_m), 1)
        x, y, z = np.unravel_index(reachable, grid.shape)
        middle = step // 2
        layer = self._scenario.layer_of(kind.robot)
        on_it = (x % step == min(middle, grid.shape[0] - 1)) & (y % step == min(middle, grid.shape[1] - 1))
        if layer is None:
            on_it &= z % step == min(middle, grid.shape[2] - 1)
        order = np.lexsort((x[on_it], y[on_it], z[on_it]))
        return np.asarray(reachable[on_it][order])
