"""Mapping a cliff from the plateau above it: five ways of choosing poses (Sujan, sect. 3.2, methods 1-5).

A rover with a camera that pans and tilts maps an elevation map and must not drive over the edge. It begins by
looking at the ground all around it. Then

- `raster` takes the next place of a lattice, row by row, with one look ahead (method 1) or, `turning`, looks
  in all directions (method 2);
- `information` takes the best of poses drawn on its plateau by new information over elevation (eq. 3), its
  edge a straight line (method 3) or a polygon (method 4), without or with the interest function (method 5).

Unknown columns have the mean height of their neighbours (fig. 7). Ours: a rover drives only where all of its
body, and a column more, stands on columns that were measured, or on which it stood before; poses are drawn
uniformly and look down by up to 60°; unknown heights have a standard deviation of a voxel edge; raster looks
30° down and, where no place is left, scans again from where it is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from baselines.strategies.next_best_view.elevation_view import (
    Camera,
    Ground,
    fill_new_information,
    fill_visibility,
)
from baselines.strategies.next_best_view.plateau import PlateauPaths, safe_columns
from baselines.strategies.next_best_view.rating import pose_distance, rating
from entropy_explore_env.belief.elevation import ElevationMap, completed, elevation_map
from entropy_explore_env.errors import SettingError
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.validation import check_choice, check_count, check_kind, check_positive, check_within

_STEEP_RAD = math.radians(60.0)
"""Poses look down by at most this, and so does the first look around."""
_AHEAD_RAD = math.radians(30.0)
"""How far raster looks down."""
_UNKNOWN_SIGMA = 1.0
"""Of heights that are not measured, in voxel edges."""
_COMPLETION_M = 0.05
"""To which unknown heights are completed."""
_GOES_ON = (MoveEnd.ARRIVED, MoveEnd.UNDER_WAY)
"""Ends of a drive after which a rover keeps its goal."""
_MARGIN = 1.0
"""Columns that a rover keeps from those that may not carry it: at the edge a map can be a column wrong."""
_SAME_PLACE = 0.75
"""Voxel edges: a rover this near has arrived."""


@dataclass(frozen=True)
class CliffConfig:
    """How poses are chosen.

    Attributes:
        choice: `information` or `raster`: see the top of the file.
        turning: `raster`: whether it looks in all directions from each place, or always along x.
        edge: `information`: whether poses lie behind the straight `line` that fits the edge best, or in its
            `polygon`.
        interest_decay: β of eq. 9; 0 = no interest is lost.
        poses: m, drawn at each decision.
        distance_weight: w_d, bits a metre or radian, against w_NI = 1.
        most_measurements: n_max of eq. 3.
        wheel_m: Diameter of a wheel: a step that is higher is no part of the plateau, and the polygon is this
            near to the edge.
        spacing_m: `raster`: between its places.

    Raises:
        SettingError: One of them is not allowed.
    """

    choice: Literal["information", "raster"] = "information"
    turning: bool = True
    edge: Literal["line", "polygon"] = "polygon"
    interest_decay: float = 1.0
    poses: int = 100
    distance_weight: float = 1.0
    most_measurements: int = 4
    wheel_m: float = 0.2
    spacing_m: float = 1.0

    def __post_init__(self) -> None:
        """Check every field."""
        check_choice(self, "choice", Literal["information", "raster"])
        check_choice(self, "edge", Literal["line", "polygon"])
        check_kind(self, "turning", bool)
        check_count(self, "poses", 1, 100_000)
        check_count(self, "most_measurements", 1, 1_000_000)
        check_within(self, "interest_decay", "distance_weight", least=0.0, most=1e6)
        check_positive(self, "wheel_m", "spacing_m")


@dataclass
class Look:
    """A scan that was expected to show something, and what it showed."""

    expected: float
    """New columns, the sum of P_V over unknown ones."""
    obtained: int = 0
    """Columns that were unknown before it."""


@dataclass
class Memory:
    """What is kept of a rover from one decision to the next."""

    interest: np.ndarray
    """(X, Y) float64, eq. 9."""
    stood: np.ndarray
    """(X, Y) bool, columns that its body has stood on."""
    paths: PlateauPaths
    first_yaws: list[float]
    """Looks around that are left to do."""
    known: ElevationMap | None = None
    """At the latest decision."""
    height_m: np.ndarray | None = None
    """(X, Y) completed at the latest decision, within the window."""
    window: tuple[slice, slice] = (slice(0, None), slice(0, None))
    """The columns that can be seen from where something is known, and a few more."""
    goal: np.ndarray | None = None
    """(5,) pose that it is under way to."""
    visibility: np.ndarray | None = None
    """(X, Y) P_V from the goal, of a look that was expected to show something."""
    taken: dict[tuple[int, int], int] = field(default_factory=dict)
    """`raster`: place → looks taken there."""


class CliffMapping:
    """Maps a cliff from above; see the top of the file.

    Attributes:
        looks: Robot → what its chosen scans were expected to show and showed, in order.
    """

    def __init__(self, config: CliffConfig | None = None) -> None:
        """Take the settings; None = the defaults, method 5."""
        self.config = config or CliffConfig()

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """A new mission begins.

        Raises:
            SettingError: A robot of the team needs no ground, or looks level.
        """
        for kind in scenario.kinds:
            if scenario.ground_layer_of(kind.robot) is None or scenario.looks_level(kind.robot):
                allowed = "a team of rovers: Robot.above_ground_m and Robot.tilts are set, as in `cliff`"
                raise SettingError("Scenario.robot", kind.robot.motion, allowed)
        self._scenario, self._rng = scenario, rng
        self._memories: dict[int, Memory] = {}
        self.looks: dict[int, list[Look]] = {}

    def choose(self, view: RobotView) -> np.ndarray:
        """Return the viewpoint (5,), map frame, by its own belief."""
        return self._choose(view)

    def interest(self, robot: int) -> np.ndarray:
        """(X, Y) interest of a rover in each column (eq. 9)."""
        return self._memories[robot].interest

    def _choose(self, view: RobotView) -> np.ndarray:
        memory = self._memory(view)
        known = self._measured(view)
        here = self._column(view.pose)
        if memory.first_yaws:
            return np.array([*view.pose[:3], memory.first_yaws.pop(), _STEEP_RAD])
        if memory.goal is not None and self._arrived(view, memory.goal):
            self._learn(view, memory, known)
            memory.goal = None
        elif view.move_end not in _GOES_ON:
            memory.goal = memory.visibility = None
        memory.known = known
        grid = self._scenario.grid
        self._stand(view, memory)
        self._complete(view, memory)
        reachable = memory.paths.start(self._safe(view, memory, here), here)
        if memory.goal is not None and not reachable[self._column(memory.goal)]:
            memory.goal = None
        if memory.goal is None:
            raster = self.config.choice == "raster"
            memory.goal = (
                self._raster(view, memory, reachable) if raster else self._best(view, memory, reachable)
            )
        stop, origin = memory.goal.copy(), np.asarray(grid.origin_m)[:2]
        places = [(place[:2] - origin) / grid.voxel_size_m for place in (view.pose, memory.goal)]
        stop[:2] = origin + memory.paths.first_corner(places[0], places[1]) * grid.voxel_size_m
        return stop

    def _memory(self, view: RobotView) -> Memory:
        if view.robot not in self._memories:
            shape = self._scenario.grid.shape[:2]
            wide = view.kind.sensor.field_of_view_rad[0]
            turns = math.ceil(2.0 * math.pi / max(wide, 0.1) - 1e-9)
            yaws = [view.pose[3] + 2.0 * math.pi * turn / turns for turn in range(turns)]
            self._memories[view.robot] = Memory(
                np.ones(shape), np.zeros(shape, bool), PlateauPaths(shape), yaws
            )
            self.looks[view.robot] = []
            self._stand(view, self._memories[view.robot])
        return self._memories[view.robot]

    def _complete(self, view: RobotView, memory: Memory) -> None:
        """Fill in unknown heights as far as the sensor reaches from columns that are known."""
        known = memory.known
        assert known is not None
        anywhere = known.known | memory.stood
        reach = math.ceil(min(self._camera(view).reach, sum(anywhere.shape))) + 1
        rows, columns = (np.flatnonzero(anywhere.any(axis=axis)) for axis in (1, 0))
        memory.window = (
            slice(max(int(rows[0]) - reach, 0), int(rows[-1]) + reach + 1),
            slice(max(int(columns[0]) - reach, 0), int(columns[-1]) + reach + 1),
        )
        heights = np.where(memory.stood & ~known.known, self._ground_m(view), known.height_m)
        if memory.height_m is None:
            memory.height_m = np.full(heights.shape, heights[anywhere].min())
        here = memory.window
        filled = completed(heights[here], anywhere[here], _COMPLETION_M, memory.height_m[here])
        memory.height_m[here] = filled

    def _measured(self, view: RobotView) -> ElevationMap:
        scenario = self._scenario
        sigma_min = view.kind.sensor.sigma_min
        return elevation_map(view.mean, view.precision, scenario.grid, scenario.sigma_prior, sigma_min)

    def _column(self, pose: np.ndarray) -> tuple[int, int]:
        """The column of a pose; the nearest one for poses outside."""
        x, y = np.clip(
            self._scenario.grid.voxel_of(pose[:3])[:2], 0, np.array(self._scenario.grid.shape[:2]) - 1
        )
        return int(x), int(y)

    def _ground_m(self, view: RobotView) -> float:
        """Height of the ground that carries a rover."""
        layer = self._scenario.ground_layer_of(view.kind.robot)
        assert layer is not None  # `reset` has checked it
        return float(self._scenario.grid.origin_m[2] + (layer + 1) * self._scenario.grid.voxel_size_m)

    def _arrived(self, view: RobotView, goal: np.ndarray) -> bool:
        apart_m = float(np.linalg.norm(view.pose[:2] - goal[:2]))
        return not view.under_way and apart_m < _SAME_PLACE * self._scenario.grid.voxel_size_m

    def _stand(self, view: RobotView, memory: Memory) -> None:
        """Note the columns that the body covers where it is: they carry it."""
        grid = self._scenario.grid
        here = (view.pose[:2] - np.asarray(grid.origin_m)[:2]) / grid.voxel_size_m
        radius = view.kind.robot.body_radius_m / grid.voxel_size_m
        low = np.maximum(np.floor(here - radius).astype(int), 0)
        high = np.floor(here + radius).astype(int) + 1
        beside = memory.stood[low[0] : high[0], low[1] : high[1]]
        x, y = np.ogrid[: beside.shape[0], : beside.shape[1]]
        gaps = [
            np.maximum(np.abs(at + 0.5 - to) - 0.5, 0.0) for at, to in zip((x, y), here - low, strict=True)
        ]
        beside |= gaps[0] ** 2 + gaps[1] ** 2 < radius**2

    def _safe(self, view: RobotView, memory: Memory, here: tuple[int, int]) -> np.ndarray:
        """(X, Y) bool, in the middle of which columns the rover may stand."""
        from baselines.strategies.next_best_view.edge import (  # scikit-image: only where it is needed
            behind_line,
            find_edge,
            inside_polygon,
        )

        assert memory.known is not None and memory.height_m is not None
        config, edge_m = self.config, self._scenario.grid.voxel_size_m
        wheel = config.wheel_m / edge_m
        window = memory.window
        above_m = memory.known.height_m[window] - self._ground_m(view)
        carrying = (above_m > -edge_m) & (
            above_m <= config.wheel_m
        )  # the highest voxel is that of the ground
        carrying = (carrying & memory.known.known[window]) | memory.stood[window]
        here = here[0] - window[0].start, here[1] - window[1].start
        edge = find_edge(memory.height_m[window], here, config.wheel_m, wheel, wheel)
        if config.choice == "information":
            line = config.edge == "line"
            within = behind_line(edge, here) if line else inside_polygon(edge.polygon, carrying.shape)
            carrying &= within | memory.stood[window]
        safe = np.zeros(memory.stood.shape, bool)
        safe[window] = safe_columns(carrying, view.kind.robot.planning_radius_m / edge_m + _MARGIN)
        return safe

    def _raster(self, view: RobotView, memory: Memory, reachable: np.ndarray) -> np.ndarray:
        """The next place of the lattice, row by row; the rover's own pose where none is left."""
        step = max(round(self.config.spacing_m / self._scenario.grid.voxel_size_m), 1)
        yaws = self._yaws(view)
        x, y = np.nonzero(reachable)
        on_it = (x % step == step // 2) & (y % step == step // 2)
        order = np.lexsort((x[on_it], y[on_it]))
        places = zip(x[on_it][order].tolist(), y[on_it][order].tolist(), strict=True)
        for place in [*list(memory.taken)[-1:], *places]:  # all looks of a place come first
            done = memory.taken.get(place, 0)
            if done < len(yaws) and reachable[place]:
                memory.taken[place] = done + 1
                return self._pose_at(view, place, yaws[done], _AHEAD_RAD)
        return view.pose.copy()

    def _yaws(self, view: RobotView) -> list[float]:
        if not self.config.turning:
            return [0.0]
        turns = math.ceil(2.0 * math.pi / max(view.kind.sensor.field_of_view_rad[0], 0.1) - 1e-9)
        return [2.0 * math.pi * turn / turns for turn in range(turns)]

    def _best(self, view: RobotView, memory: Memory, reachable: np.ndarray) -> np.ndarray:
        """The best rated of poses drawn in reachable columns."""
        config, grid = self.config, self._scenario.grid
        columns = np.argwhere(reachable)
        drawn = columns[self._rng.integers(len(columns), size=config.poses)]
        yaws = self._rng.uniform(-math.pi, math.pi, config.poses)
        pitches = self._rng.uniform(0.0, _STEEP_RAD, config.poses)
        poses = np.zeros((config.poses, 5))
        poses[:, :2] = np.asarray(grid.origin_m)[:2] + (drawn + 0.5) * grid.voxel_size_m
        poses[:, 2], poses[:, 3], poses[:, 4] = view.pose[2], yaws, pitches
        ground, camera = self._ground(memory), self._camera(view)
        scaled, bits = self._in_edges(poses), np.empty(config.poses)
        fill_new_information(ground, camera, float(config.most_measurements), scaled, bits)
        worth = [
            rating(new, config.distance_weight * pose_distance(view.pose, pose), 0.0)
            for new, pose in zip(bits.tolist(), poses, strict=True)
        ]
        best = int(np.argmax(worth))
        memory.visibility = np.empty(reachable.shape)
        fill_visibility(ground, camera, scaled[best], memory.visibility)
        assert memory.known is not None
        self.looks[view.robot].append(Look(float(memory.visibility[~memory.known.known].sum())))
        return poses[best]

    def _ground(self, memory: Memory) -> Ground:
        """The elevation map in voxel edges above the workspace's floor."""
        assert memory.known is not None and memory.height_m is not None
        grid, known = self._scenario.grid, memory.known
        sigma = np.where(known.known, known.sigma_m / grid.voxel_size_m, _UNKNOWN_SIGMA)
        height = (memory.height_m - grid.origin_m[2]) / grid.voxel_size_m
        return Ground(height, sigma, known.measurements, memory.interest)

    def _camera(self, view: RobotView) -> Camera:
        sensor = view.kind.sensor
        yaw, pitch = sensor.field_of_view_rad
        return Camera(0.5 * yaw, 0.5 * pitch, sensor.max_range_m / self._scenario.grid.voxel_size_m)

    def _in_edges(self, poses: np.ndarray) -> np.ndarray:
        """(K, 5) poses with their places in voxel edges from the lower corner."""
        scaled = poses.copy()
        scaled[:, :3] = (
            scaled[:, :3] - np.asarray(self._scenario.grid.origin_m)
        ) / self._scenario.grid.voxel_size_m
        return scaled

    def _pose_at(self, view: RobotView, column: tuple[int, int], yaw: float, pitch: float) -> np.ndarray:
        grid = self._scenario.grid
        place = np.asarray(grid.origin_m)[:2] + (np.array(column) + 0.5) * grid.voxel_size_m
        return np.array([*place, view.pose[2], yaw, pitch])

    def _learn(self, view: RobotView, memory: Memory, now: ElevationMap) -> None:
        """Compare what the latest chosen look showed with what it should have, and lose interest (eq. 9)."""
        if memory.visibility is None or memory.known is None:
            return
        self.looks[view.robot][-1].obtained = int((now.known & ~memory.known.known).sum())
        silent = now.measurements <= memory.known.measurements
        decay = np.exp(-self.config.interest_decay * memory.visibility[silent])
        memory.interest[silent] *= decay
        memory.visibility = None
