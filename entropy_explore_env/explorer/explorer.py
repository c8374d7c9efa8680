"""The planner on any map: a map and the robots' poses in, the next goal of a robot out.

It needs neither a simulator nor ROS, and decides as robots of missions do: `planned-rate`, or any strategy,
chooses from a `RobotView`, which is filled here from what the map says instead of from a mission. Poses are
(x, y, z, yaw, pitch) in the map's frame, metres and radians, pitch downwards. The robots share one belief.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from entropy_explore_env.belief.belief_map import Map
from entropy_explore_env.errors import SettingError
from entropy_explore_env.explorer.canvas import grid_of
from entropy_explore_env.explorer.given_maps import (
    UNKNOWN_BETWEEN,
    Patch,
    Values,
    checked_origin,
    has_size,
    numbers_of,
    occupancies_of,
    patch_of_map,
    patch_of_occupancies,
)
from entropy_explore_env.explorer.goals import (
    NOTHING_BITS,
    Decider,
    Goal,
    NoGoal,
    Why,
    check_decider,
    checked_pose,
    poses_by_number,
    purpose_of,
)
from entropy_explore_env.explorer.ground import Ground, boxes_around
from entropy_explore_env.explorer.planned_rate import PlannedRate
from entropy_explore_env.explorer.task import task_of
from entropy_explore_env.explorer.team import Seat, view_of_seat
from entropy_explore_env.explorer.workspace import Outlook, Workspace
from entropy_explore_env.interop.messages import grid_of_message
from entropy_explore_env.missions.records import HEARD
from entropy_explore_env.planner.weights import PlannerWeights, shipped_weights
from entropy_explore_env.randomness import Stream, check_seed, generator
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.robots.rotations import turned_by
from entropy_explore_env.settings.robot import Robot
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.sensor import RangeSensor
from entropy_explore_env.settings.validation import is_number, is_whole

_SAME_PLACE = 1e-3
"""Voxel edges by which a robot may miss its viewpoint and stand in it all the same."""


class Explorer:
    """Chooses goals for robots on a map that is given.

        explorer = Explorer(voxel_size_m=0.05, robots=3)
        explorer.set_map(grid, origin=(-10.0, -8.0, 0.0))
        goal = explorer.goal(poses, robot=0)

    Maps may grow and move from call to call. Unknown margins are cropped. Where the map outgrows its crop,
    `planned-rate` goes on in a larger one. A strategy without `grow` begins anew, as any strategy does where
    the map turns or moves by a fraction of a voxel.

    Attributes:
        no_goal: Why the latest call of `goal` returned None; None = it did not.
    """

    def __init__(
        self,
        scenario: str | Scenario | None = None,
        *,
        robot: Robot | None = None,
        sensor: RangeSensor | None = None,
        voxel_size_m: float | None = None,
        robots: int | None = None,
        strategy: Decider | None = None,
        weights: PlannerWeights | str | None = None,
        seed: int = 0,
        arrival_m: float = 0.25,
    ) -> None:
        """Take the settings; a map follows.

        Args:
            scenario: A Scenario or its name, whose robots, sensors and ending count; its grid is the map's
                until a map with another is set. None = ground robots with a scanner that see everything.
            robot: How the robots move, in place of the scenario's.
            sensor: What they sense, in place of the scenario's.
            voxel_size_m: Edge of the maps' voxels, in place of the scenario's.
            robots: Number of robots; None = the scenario's, and 1 without one.
            strategy: An object that chooses the viewpoints; None = `planned-rate`.
            weights: Weights of the planner's features, or the name of weights that come with the library,
                "plans"; None = it has none.
            seed: Seed of all random draws.
            arrival_m: A robot this near to its viewpoint, or nearer, has reached it.

        Raises:
            SettingError: A setting is not allowed.
        """
        if strategy is not None and weights is not None:
            raise SettingError("weights", weights, "None where a strategy is given")
        if strategy is not None:
            check_decider(strategy)
        if not is_number(arrival_m) or not 0.0 <= arrival_m < math.inf:
            raise SettingError("arrival_m", arrival_m, "a finite number ≥ 0")
        self._task = task_of(scenario, robots, robot, sensor, voxel_size_m)
        planned = shipped_weights(weights) if isinstance(weights, str) else weights
        # goals may be asked for at any rate: predictions are tuned for robots that decide at stops
        self._strategy = PlannedRate(planned, foresight=None) if strategy is None else strategy
        self._seed, self._arrival_m = check_seed(seed), float(arrival_m)
        self._seats = [Seat() for _ in range(self._task.robots)]
        self._heard = np.zeros(self._task.robots, HEARD)
        self._heard["heard_s"] = self._heard["announced_s"] = -1.0
        self._shape: tuple[int, ...] | None = None
        self._corner = (0.0, 0.0, 0.0)
        self._begun, self._yaw_rad, self._time_s = 0, 0.0, 0.0
        self._unbegun: set[int] = set()
        self.no_goal: NoGoal | None = None
        self._ground = Ground(self._task, fixed=scenario is not None and voxel_size_m is None)
        self._follow()

    def _follow(self) -> None:
        """Let the strategy go on where the canvas has grown, or begin anew where it is another one."""
        if self._begun == self._ground.begun:
            return
        workspace, shift = self._ground.workspace, self._ground.shift
        episode, self._begun = self._begun, self._ground.begun
        grow = getattr(self._strategy, "grow", None)
        if shift is None or grow is None:
            self._strategy.reset(workspace.scenario, generator(self._seed, episode, Stream.STRATEGY))
            self._unbegun = set(range(len(self._seats)))
        else:
            grow(workspace.scenario, shift)
        workspace.search = getattr(self._strategy, "search", None)
        turn_rad = self._yaw_rad - workspace.canvas.yaw_rad
        for seat in self._seats:
            seat.turn(turn_rad)
        for name in ("pose", "announced"):
            self._heard[name][:, :5] = turned_by(self._heard[name][:, :5], turn_rad)
        self._yaw_rad = workspace.canvas.yaw_rad

    @property
    def map(self) -> Map:
        """What is believed now: see `Map`.

        Raises:
            CallOrderError: Neither a map nor a scan was given.
        """
        canvas = self._ground.workspace.canvas
        corner = turned_by(np.asarray(canvas.grid.origin_m), canvas.yaw_rad)
        grid = grid_of(np.array(canvas.grid.shape), canvas.grid.voxel_size_m, corner)
        return Map(grid, canvas.mean, canvas.precision, self._task.sigma_prior, canvas.yaw_rad)

    def set_map(
        self,
        grid: np.ndarray | Map,
        origin: Sequence[float] | None = None,
        *,
        bottom_m: float = 0.0,
        values: Values | None = None,
        unknown_between: tuple[float, float] = UNKNOWN_BETWEEN,
    ) -> None:
        """Take a map in place of what was believed of the voxels that it covers.

        Args:
            grid: (X, Y) or (X, Y, Z) occupancies, see `given_maps.occupancies_of`; or a Map with σ.
            origin: (x, y, yaw) of the grid's corner in the map frame, yaw counter-clockwise about it. None =
                as that of the latest map, if this one has its size; of the first one (0, 0, 0).
            bottom_m: Height z of the corner.
            values: What the numbers of a grid are, where their type does not say it.
            unknown_between: Probabilities from the first to the second are unknown.

        Raises:
            SettingError: The grid is no map, has another size than the latest one and no origin, or holds
                nothing that is known. Nothing has changed then.
        """
        if isinstance(grid, Map):
            for name, value, usual in (
                ("origin", origin, origin is None),
                ("bottom_m", bottom_m, is_number(bottom_m) and bottom_m == 0.0),
                ("values", values, values is None),
                ("unknown_between", unknown_between, unknown_between is UNKNOWN_BETWEEN),
            ):
                if not usual:
                    raise SettingError(name, value, "no value beside a Map")
            self._take_map(patch_of_map(grid, self._task))
            return
        given = occupancies_of(grid, values, unknown_between)
        if not is_number(bottom_m) or not abs(bottom_m) <= 1e9:
            raise SettingError("bottom_m", bottom_m, "a finite number")
        if origin is None and self._shape not in (None, given.grid.shape):
            raise SettingError("origin", None, f"(x, y, yaw) of a map that is no longer {self._shape}")
        corner = self._corner if origin is None else checked_origin(origin)
        self._take_map(patch_of_occupancies(given, corner, float(bottom_m), self._task))

    def set_map_message(self, message: Any, **how: Any) -> None:  # noqa: ANN401 - any class with the fields
        """Take a nav_msgs/OccupancyGrid of any class, whose rows run along x; `how` as for `set_map`.

        Raises:
            SettingError: It is no OccupancyGrid, or its voxels have another size. Nothing has changed then.
        """
        about = grid_of_message(message)
        if not has_size(about.resolution_m, self._task):
            allowed = f"voxel_size_m, which is {self._task.grid.voxel_size_m:g}"
            raise SettingError("message.info.resolution", about.resolution_m, allowed)
        bottom_m = 0.0 if self._task.planar else about.bottom_m
        self.set_map(about.grid, about.origin, bottom_m=bottom_m, **{"values": "percent", **how})

    def _take_map(self, patch: Patch) -> None:
        """Write a map into the canvas, and say to each robot what that brought in view of its target."""
        low = self._ground.room_for(patch)
        self._follow()
        scenario, grid = self._ground.workspace.scenario, self._ground.workspace.canvas.grid
        reaches_m = [scenario.kind_of(number).sensor.max_range_m for number in range(len(self._seats))]
        boxes = boxes_around([seat.target for seat in self._seats], reaches_m, grid)
        bits, gains = self._ground.write(low, patch, boxes)
        for seat, gain in zip(self._seats, gains.tolist(), strict=True):
            seat.note_map(gain, bits - gain)
        self._shape, self._corner = patch.shape, patch.corner

    def add_scan(self, pose: Sequence[float] | np.ndarray, measured: np.ndarray, robot: int = 0) -> float:
        """Fuse a scan into the belief, and return the bits that it brought.

        Args:
            pose: (5,) of the sensor, map frame.
            measured: (R,) ranges in metres along the sensor's R rays: 0, negative or NaN where nothing was
                measured. A range beyond the sensor's, or inf, means that the ray is free up to the sensor's.
                Or (N, 3) points in the map frame, a hit each.
            robot: Number of the robot that took it.

        Raises:
            SettingError: The pose is not finite or outside a scenario's grid, or the scan has another shape.
                Nothing has changed then.
        """
        number, place = self._checked_robot(robot), checked_pose("pose", pose)
        values = numbers_of(measured)
        sensor, points = self._task.kind_of(number).sensor, values.ndim == 2 and values.shape[1] == 3
        rays = sensor.columns if self._ground.flat else sensor.rays
        if points and not np.isfinite(values).all():
            raise SettingError("measured", measured, "finite points")
        if not points and values.shape != (rays,):
            allowed = f"({rays},) ranges, one for each ray of the sensor, or (N, 3) points"
            raise SettingError("measured", values.shape, allowed)
        self._ground.room_for_scan(place, sensor)
        self._follow()
        workspace = self._ground.workspace
        at = workspace.placed(number, place, "pose")
        if points:
            hits = turned_by(values, -workspace.canvas.yaw_rad)
            hits[:, 2] = at[2] if workspace.canvas.grid.flat else hits[:, 2]
            fused, ranges_m = workspace.fuse_points(number, at, hits), np.linalg.norm(hits - at[:3], axis=1)
        else:
            fused, ranges_m = workspace.fuse_ranges(number, at, values), values
        self._ground.entropy_bits -= fused.total_bits
        for other, seat in enumerate(self._seats):
            seat.heard_bits += 0.0 if other == number else fused.total_bits
        self._seats[number].note_scan(at, ranges_m, sensor.max_range_m, fused)
        return fused.total_bits

    def goal(
        self,
        poses: np.ndarray | Sequence[Any] | Mapping[int, Any],
        robot: int = 0,
        *,
        ended: MoveEnd | None = None,
        time_s: float | None = None,
    ) -> Goal | None:
        """Return where a robot goes next, or None: `no_goal` says why.

        Args:
            poses: (A, 5) of all robots, (5,) of the only one, or number → (5,) of those that are heard: the
                others count as silent, and their places as where they were last heard.
            robot: Number of the robot that decides.
            ended: How its latest drive ended; None = it arrived if it is near to its goal, or had none, and
                is under way otherwise. A drive that was blocked is not tried again at once.
            time_s: Now; None = estimated from the progress of its latest drive.

        Raises:
            CallOrderError: Neither a map nor a scan was given.
            SettingError: A pose is missing, not finite, outside the map or in a wall; the clock runs back; or
                a value is not allowed. Nothing has changed then.
        """
        workspace, number = self._ground.workspace, self._checked_robot(robot)
        given = poses_by_number(poses, len(self._seats))
        if number not in given:
            raise SettingError("poses", sorted(given), f"poses, that of robot {number} among them")
        placed = {mate: workspace.placed(mate, pose, f"poses[{mate}]") for mate, pose in given.items()}
        for mate, pose in placed.items():
            if workspace.is_wall(pose):
                raise SettingError(
                    f"poses[{mate}]", given[mate].tolist(), "a place that the map does not say is solid"
                )
        if ended is not None and not isinstance(ended, MoveEnd):
            raise SettingError("ended", ended, "a MoveEnd, or None")
        seat, pose = self._seats[number], placed[number].copy()
        end = self._move_end(seat, pose, number) if ended is None else ended
        now_s = self._checked_time(time_s, workspace, number, pose, end)
        if end is MoveEnd.ARRIVED:
            self._settle(seat, pose, number)
        self._time_s = now_s
        for mate, other in enumerate(self._seats):
            other.here = mate in placed
            if other.here:
                self._heard[mate]["heard_s"], self._heard[mate]["pose"] = now_s, placed[mate]
        chosen, self.no_goal = self._chosen(workspace, number, pose, end), None
        if end is not MoveEnd.UNDER_WAY:
            seat.count_bits()
        if chosen is None:
            self.no_goal = NoGoal.OUT_OF_REACH if workspace.beside_unknown() else NoGoal.ALL_SEEN
            seat.target, seat.due_s = pose.copy(), now_s
            return None
        viewpoint, outlook, homewards = chosen
        seat.target, seat.due_s = viewpoint.copy(), now_s + outlook.seconds
        heard = self._heard[number]
        heard["announced_s"], heard["announced"][:5] = now_s, viewpoint
        heard["announced"][5:] = seat.depth_m, seat.half_angle_rad
        why = Why.RETURNS if homewards else purpose_of(outlook.bits, end)
        return self._told(workspace, given[number], viewpoint, outlook, why)

    def _checked_robot(self, robot: object) -> int:
        if not is_whole(robot, 0, len(self._seats) - 1):
            raise SettingError("robot", robot, f"a whole number from 0 to {len(self._seats) - 1}")
        return int(robot)

    def _checked_time(
        self, time_s: object, workspace: Workspace, robot: int, pose: np.ndarray, end: MoveEnd
    ) -> float:
        """Return the time of a decision, given or by how much of its latest goal the robot has done."""
        if time_s is None:
            seat, left_s = self._seats[robot], 0.0
            if end is MoveEnd.UNDER_WAY and seat.target is not None:
                left_s = workspace.outlook(robot, pose, seat.target).seconds
            return max(self._time_s, seat.due_s - left_s)
        if not is_number(time_s) or not self._time_s <= time_s < np.inf:
            raise SettingError("time_s", time_s, f"finite seconds, not before {self._time_s:g}")
        return float(time_s)

    def _apart_m(self, robot: int, place: np.ndarray, other: np.ndarray) -> float:
        """Return the distance between two places, of a robot in a plane along it."""
        axes = 3 if self._ground.workspace.scenario.plane_m(robot) is None else 2
        return float(np.linalg.norm(place[:axes] - other[:axes]))

    def _move_end(self, seat: Seat, pose: np.ndarray, robot: int) -> MoveEnd:
        """Return how a robot's latest drive ended, by where it is."""
        if seat.target is None or self._apart_m(robot, pose, seat.target) <= self._arrival_m:
            return MoveEnd.ARRIVED
        return MoveEnd.UNDER_WAY

    def _settle(self, seat: Seat, pose: np.ndarray, robot: int) -> None:
        """Put a robot that arrived near its viewpoint into it, as rules ask for that very voxel."""
        if seat.target is None:
            return
        apart_m = self._apart_m(robot, pose, seat.target)
        if _SAME_PLACE * self._task.grid.voxel_size_m < apart_m <= self._arrival_m:
            pose[:3] = seat.target[:3]

    def _chosen(
        self, workspace: Workspace, robot: int, pose: np.ndarray, end: MoveEnd
    ) -> tuple[np.ndarray, Outlook, bool] | None:
        """Return the viewpoint that the strategy chooses, what is expected of it, and whether it leads home.

        None = it has none. A rule begins by a look around; on a map that shows all around already, that is
        taken as done.
        """
        seat, homewards = self._seats[robot], False
        together = getattr(self._strategy, "choose_all", None)
        found_nothing = getattr(self._strategy, "found_nothing", None)
        while True:
            moment = self._time_s, end, self._ground.entropy_bits
            view = view_of_seat(workspace, self._seats, self._heard, robot, pose, moment)
            chosen = self._strategy.choose(view) if together is None else together([view])[0]
            viewpoint = checked_pose("viewpoint chosen", chosen)
            if found_nothing is not None and found_nothing(robot):
                homewards = self._task.ending.return_to_start
                if not homewards or self._apart_m(robot, pose, viewpoint) <= self._arrival_m:
                    return None
            outlook = workspace.outlook(robot, pose, viewpoint)
            stands = self._apart_m(robot, pose, viewpoint) < 0.5 * self._task.grid.voxel_size_m
            begins = robot in self._unbegun
            self._unbegun.discard(robot)
            if not (begins and stands and outlook.bits <= NOTHING_BITS):
                return viewpoint, outlook, homewards
            seat.target, end = viewpoint.copy(), MoveEnd.ARRIVED

    def _told(
        self, workspace: Workspace, given: np.ndarray, viewpoint: np.ndarray, outlook: Outlook, why: Why
    ) -> Goal:
        """Return a goal in the map frame; a robot in a plane keeps the height that it was given."""
        yaw_rad = workspace.canvas.yaw_rad
        there, path = turned_by(viewpoint, yaw_rad), turned_by(outlook.path, yaw_rad)
        if workspace.scenario.in_planes:
            there[2] = path[:, 2] = given[2]
        return Goal(there, path, outlook.bits, outlook.seconds, why)
