"""Next-best-view mapping, and the four ways of choosing poses that its paper compares it with.

Sujan & Meggiolaro, "Simultaneous Localization and Mapping for Mobile Robot Teams with Visual Sensors". Of m
poses drawn in known free space (P_occ < 0.05) that a known free path reaches, a robot takes (sect. 3.1)

- `next-best-view`: the one with the best rating RF = (NI - w_d·d)·(1 - P_occ) (eq. 23), method (v);
- `most-unmapped`: the one that shows the largest unmapped region, method (iii);
- `least-mapped`: the one that shows the smallest mapped region, method (iv);
- `random-known`: the first, method (i).

`raster` takes the next place in row order that it has not scanned from, method (ii), and looks in all
directions there, or (`raster-fixed-yaw`) in one. Teams share their maps, and each robot chooses by itself.

Unknown cells of a plan take the mean occupancy of their neighbours, for `next-best-view` alone, as in the
paper. A voxel that should have been visible and did not answer loses interest (eq. 9). A robot is taken to
know where it is, so that the paper's localization error LE is 0.

Ours, where the paper says nothing: poses are drawn uniformly, a new set at each decision; the spacing of
raster's places; where nothing known can be reached, or a teammate is in the way, a robot goes to a random
viewpoint; where a drive was stopped otherwise it draws anew; where its latest scan showed no new voxel,
methods (iii) and (iv) take a random pose, since they would take the same nook for ever; a world with an
exposure surface is refused.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from baselines.strategies.explorers.frontier_cells import KNOWN_SIGMA, FrontierCells
from baselines.strategies.explorers.path_lengths import KnownPaths
from baselines.strategies.explorers.stops import apart_m, stop_towards
from baselines.strategies.knowledge import belief_of, voxel_of
from baselines.strategies.next_best_view.expected_view import (
    OccupancyMap,
    extrapolated,
    look,
    new_scratch,
    new_view,
    occupancy_map,
    voxels_in_view,
)
from baselines.strategies.next_best_view.rating import UNCERTAINTY, new_information, pose_distance, rating
from baselines.strategies.protocol import random_viewpoint
from entropy_explore_env.belief.paths.search import new_search
from entropy_explore_env.errors import SettingError
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.settings import RobotKind
from entropy_explore_env.validation import check_choice, check_count, check_kind, check_positive, check_within
from entropy_explore_env.viewpoints.evaluation import robot_model

Choice = Literal["information", "most-unmapped", "least-mapped", "random"]
Measure = Literal["uncertainty", "stretched", "linear"]
_BY_COUNT = ("most-unmapped", "least-mapped")
_LARGEST_OCCUPANCY = 0.05
_GOES_ON = (MoveEnd.ARRIVED, MoveEnd.CORNERS, MoveEnd.UNDER_WAY)
"""Ends of a drive after which a robot keeps its goal."""
_STEEPEST_RAD = math.pi / 4
"""Robots that look up and down draw their pitch within this."""
_SAME_PLACE = 0.75
"""Voxel edges: a robot this near has arrived."""


@dataclass(frozen=True)
class NextBestViewConfig:
    """How poses are chosen.

    Attributes:
        choice: `information`, `most-unmapped`, `least-mapped` or `random`: see the top of the file.
        poses: m, drawn at each decision.
        distance_weight: w_d, bits a metre or radian, against w_NI = 1.
        measure: New information by eq. 8, `uncertainty`, which the paper thinks better, or by eqs. 6-7,
            `stretched`; `linear` is eq. 8 with q in place of -q log2 q, ours.
        extrapolated: Whether unknown cells of a plan take the mean occupancy of their neighbours; else ½.
        interest_decay: β of eq. 9: a voxel that did not answer keeps e^-β of the interest in it.

    Raises:
        SettingError: One of them is not allowed.
    """

    choice: Choice = "information"
    poses: int = 100
    distance_weight: float = 0.01
    measure: Measure = "uncertainty"
    extrapolated: bool = True
    interest_decay: float = 1.0

    def __post_init__(self) -> None:
        """Check every field."""
        check_choice(self, "choice", Choice)
        check_choice(self, "measure", Measure)
        check_kind(self, "extrapolated", bool)
        check_count(self, "poses", 1, 100_000)
        check_within(self, "distance_weight", "interest_decay", least=0.0, most=1e6)


@dataclass
class Memory:
    """What is kept of a robot from one decision to the next."""

    cells: FrontierCells
    paths: KnownPaths
    interest: np.ndarray
    """(V,) float32, eq. 9."""
    goal: np.ndarray | None = None
    """(5,) pose that it is under way to."""
    occupancy: np.ndarray | None = None
    """(V,) float32 as extrapolated at the latest decision."""
    measured: int = 0
    """Voxels that were measured at the latest decision."""
    scanned: bool = False
    """Whether the first scan was taken."""
    expected: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int32))
    """Unknown voxels that should be visible from the goal."""


class KnownSpace:
    """Drives robots to poses in known free space; a subclass says to which, with `pick`."""

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """A new mission begins."""
        self._scenario, self._rng = scenario, rng
        self._search = new_search(scenario.grid.voxels)
        self._memories: dict[int, Memory] = {}

    def choose(self, views: Sequence[RobotView]) -> list[np.ndarray]:
        """(5,) viewpoint of each view, map frame, by its own belief.

        Raises:
            SettingError: The world has an exposure surface.
        """
        return [self._choose(view) for view in views]

    def pick(self, view: RobotView, memory: Memory, reachable: np.ndarray) -> np.ndarray | None:
        """(5,) the pose to go to, map frame; None = there is none.

        Args:
            view: Of the robot.
            memory: Of the robot; `expected` may be set.
            reachable: (N,) int32 voxels in which the body is known to fit, with a known free way there.
        """
        raise NotImplementedError

    def _choose(self, view: RobotView) -> np.ndarray:
        memory = self._memory(view)
        if not memory.scanned:
            memory.scanned = True
            return view.pose.copy()
        memory.cells.update(view, KNOWN_SIGMA)
        here, arrived_m = voxel_of(view, view.pose), _SAME_PLACE * self._scenario.grid.voxel_size_m
        if memory.goal is not None:
            if view.move_end not in _GOES_ON:
                memory.goal = None
                if view.move_end is MoveEnd.TEAMMATE:
                    return random_viewpoint(view, self._rng)
            elif not view.under_way and apart_m(view, memory.goal) < arrived_m:
                self._lose_interest(view, memory)
                memory.goal = None
        if memory.goal is None:
            memory.expected = memory.expected[:0]
            memory.paths.start(here)
            memory.paths.extend(math.inf)
            memory.goal = self.pick(view, memory, self._reachable(memory))
        if memory.goal is None:
            return random_viewpoint(view, self._rng)
        return self._stop(view, memory, here, memory.goal)

    def _memory(self, view: RobotView) -> Memory:
        if view.ceiling is not None:
            raise SettingError("strategy", "next-best-view", "a world without an exposure surface")
        if view.robot not in self._memories:
            cells = FrontierCells(self._scenario, view.kind)
            paths = KnownPaths(self._scenario, view.kind, cells, self._search)
            interest = np.ones(self._scenario.grid.voxels, np.float32)
            self._memories[view.robot] = Memory(cells, paths, interest)
        return self._memories[view.robot]

    def _lose_interest(self, view: RobotView, memory: Memory) -> None:
        """Eq. 9 for the voxels that should have been seen and were not; their visibility counts as 1."""
        silent = memory.expected[
            view.precision.reshape(-1)[memory.expected] <= np.float32(self._scenario.sigma_prior**-2)
        ]
        memory.interest[silent] *= math.exp(-self.interest_decay)

    interest_decay = 0.0

    def _reachable(self, memory: Memory) -> np.ndarray:
        """(N,) int32 voxels to which the search of the robot's paths has come."""
        voxels = np.flatnonzero(np.isfinite(memory.cells.traversal_cost)).astype(np.int32)
        return voxels[np.isfinite(memory.paths.lengths_to(voxels))]

    def _stop(self, view: RobotView, memory: Memory, here: int, goal: np.ndarray) -> np.ndarray:
        """The goal, or a stop on the way to it, with the goal's gaze."""
        stop = goal.copy()
        axes = 2 if view.planar else 3
        stop[:axes] = stop_towards(view, memory.paths, here, goal)[:axes]
        return stop

    def pose_in(self, view: RobotView, voxel: int, yaw: float, pitch: float) -> np.ndarray:
        """(5,) a pose in the middle of a voxel; planar robots stay at their height and look level."""
        grid = self._scenario.grid
        place = grid.centre_of(np.stack(np.unravel_index(voxel, grid.shape)))
        if view.planar:
            place[2], pitch = view.pose[2], 0.0
        return np.array([*place, yaw, pitch])


class NextBestView(KnownSpace):
    """Takes the best of poses drawn in known free space; see the top of the file."""

    def __init__(self, config: NextBestViewConfig | None = None) -> None:
        """Take the settings; None = the defaults."""
        self.config = config or NextBestViewConfig()
        self.interest_decay = self.config.interest_decay

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """A new mission begins."""
        super().reset(scenario, rng)
        voxels = scenario.grid.voxels
        self._models = {kind: robot_model(scenario, kind, thinning=1) for kind in set(scenario.kinds)}
        longest = max(model.longest_ray for model in self._models.values())
        self._view, self._scratch = new_view(voxels), new_scratch(voxels, longest + 1)

    def pick(self, view: RobotView, memory: Memory, reachable: np.ndarray) -> np.ndarray | None:
        """See `KnownSpace`."""
        prior = self._scenario.sigma_prior**-2
        known = occupancy_map(belief_of(view), prior, memory.interest)
        free = reachable[known.occupancy[reachable] < _LARGEST_OCCUPANCY]
        if len(free) == 0:
            return None
        poses = self._drawn(view, free)
        measured = int(len(known.unknown) - known.unknown.sum())
        nothing_new, memory.measured = measured == memory.measured, measured
        if self.config.choice == "random" or (nothing_new and self.config.choice in _BY_COUNT):
            return poses[0]
        if self.config.choice == "information" and self.config.extrapolated:
            known = extrapolated(known, memory.occupancy)
            memory.occupancy = known.occupancy
        best, expected = poses[0], memory.expected
        most = -math.inf
        for pose in poses:
            worth = self._worth(view, known, pose)
            if worth > most:
                most, best = worth, pose
                expected = self._view.seen[: self._view.counts[1]].copy()
        memory.expected = expected
        return best

    def _drawn(self, view: RobotView, free: np.ndarray) -> list[np.ndarray]:
        """Poses in known free space, each voxel as likely as any other, the gaze in any direction."""
        voxels = self._rng.choice(free, self.config.poses if self.config.choice != "random" else 1)
        yaws = self._rng.uniform(-math.pi, math.pi, len(voxels))
        pitches = self._rng.uniform(-_STEEPEST_RAD, _STEEPEST_RAD, len(voxels))
        drawn = zip(voxels, yaws, pitches, strict=True)
        return [self.pose_in(view, int(voxel), float(yaw), float(pitch)) for voxel, yaw, pitch in drawn]

    def _worth(self, view: RobotView, known: OccupancyMap, pose: np.ndarray) -> float:
        """What a pose is worth by the choice that the settings name; `self._view` is what it shows."""
        config, grid = self.config, self._scenario.grid
        scan = self._models[view.kind].scan
        stretched = config.measure == "stretched"
        look(known, scan, grid.in_grid_units(pose), stretched, self._scratch, self._view)
        if config.choice == "most-unmapped":
            return float(self._view.counts[1])
        if config.choice == "least-mapped":
            return -float(self._view.counts[0])
        most = voxels_in_view(scan, view.kind.sensor.field_of_view_rad, grid.flat, grid.voxels)
        weights = None if stretched else UNCERTAINTY
        bits = new_information(self._view.shares, most, weights, config.measure == "linear")
        occupancy = float(known.occupancy[voxel_of(view, pose)])
        return rating(bits, pose_distance(view.pose, pose), config.distance_weight, occupancy)


@dataclass(frozen=True)
class RasterConfig:
    """Where raster scans from.

    Attributes:
        spacing: Between its places, in sensor ranges; of a sensor without range limit, in tenths of the
            workspace's longest side.
        turning: Whether it looks in all directions from each place, or always along x.

    Raises:
        SettingError: The spacing is not > 0.
    """

    spacing: float = 0.5
    turning: bool = True

    def __post_init__(self) -> None:
        """Check every field."""
        check_positive(self, "spacing")


class Raster(KnownSpace):
    """Scans from the places of a lattice, row by row, each as soon as it is known to be free."""

    def __init__(self, config: RasterConfig | None = None) -> None:
        """Take the settings; None = the defaults."""
        self.config = config or RasterConfig()

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """A new mission begins."""
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
        if not self.config.turning or wide <= 0.0:
            return [0.0]
        turns = math.ceil(2.0 * math.pi / wide - 1e-9)
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
