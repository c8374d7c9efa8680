"""What one robot knows: its own belief, its pose, its last scan, what teammates told it.

Strategies see this and nothing else; the truth is not in it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from entropy_explore_env.belief.belief_map import Map
from entropy_explore_env.missions.action import ROUNDING, encode_viewpoint
from entropy_explore_env.missions.localization import believed_pose
from entropy_explore_env.missions.poses import place_at, pose_at, since_scan_m, speed_at
from entropy_explore_env.missions.rules import Rules
from entropy_explore_env.missions.silence import is_silent
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.planner.records import Kind
from entropy_explore_env.robots.knowledge import RobotKnowledge, ScanView, TeammateView, place_text
from entropy_explore_env.robots.landmarks import LANDMARK
from entropy_explore_env.robots.localization import believed_point
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.worlds.world import no_fly_mask


@dataclass(frozen=True, eq=False, kw_only=True)
class RobotView(RobotKnowledge):
    """What one robot knows. Arrays are read-only and change as the mission goes on.

    A view is a moment's look at a mission: it is equal only to itself, and hashes by identity.

    Attributes:
        robot, scenario, time_s, under_way, since_scan_m, pose, covariance, mean, precision, depth_m,
            half_angle_rad, scan, move_end, teammates, ceiling: See `RobotKnowledge`.
        deciding: Whether it chooses a viewpoint now.
        speed_m_s: Its speed on its path; 0 while it stands.
        entropy_bits: Entropy of its map.
        target: (5,) the viewpoint that it chose last.
        path: (N, 3) points to which it still means to drive straight, one after the other; none while
            it stands and chooses. Where it plans it is its plan, at whose end the target need not be.
        heard: (A,) HEARD, what it heard of teammates as it came, also of those that are silent since: for
            observations.
        gained_bits: Taken from its map by its own scans since the start.
        heard_bits: Taken from its map by teammates' measurements since the start.
        candidates: (K, 5) the viewpoints that are proposed to it, the planner's own choice first; none where
            actions are no numbers of candidates, or it does not decide.
        fiducials_m: (F, 3) places of the fiducials by which it corrects its estimate (`Fiducials`).
        landmarks_m: (N, 3) where it believes the landmarks of its own map to be (`Fiducials.own_number`).
        landmarks: (N,) LANDMARK, the same with all that it knows of them; their true places are not told.
    """

    deciding: bool
    speed_m_s: float
    entropy_bits: float
    target: np.ndarray
    path: np.ndarray
    heard: np.ndarray
    gained_bits: float
    heard_bits: float
    candidates: np.ndarray
    rules: Rules
    fiducials_m: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    landmarks_m: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    landmarks: np.ndarray = field(default_factory=lambda: np.zeros(0, LANDMARK))

    def __repr__(self) -> str:
        """Return who it is, when and where, not what it holds to be true."""
        x, y, z = self.mean.shape
        state = "deciding" if self.deciding else "busy"
        who = f"robot_{self.robot} of {self.scenario.robots} in {self.scenario.name!r}"
        return (
            f"RobotView({who}, {self.time_s:g} s, "
            f"{state}, at {place_text(self.pose)}, {x} × {y} × {z} voxels, {self.entropy_bits:.6g} bits)"
        )

    def action_for(self, viewpoint: np.ndarray) -> np.ndarray | np.int64:
        """Return the action that sends the robot to a viewpoint (5,): see `encode_viewpoint`."""
        return encode_viewpoint(self.rules, self.pose, viewpoint, self.robot, self.candidates)

    @property
    def map(self) -> Map:
        """Its belief as a Map: a copy, with σ and where it lies."""
        return Map(self.scenario.grid, self.mean, self.precision, self.scenario.sigma_prior)

    def scan_places(self, path_m: np.ndarray) -> np.ndarray:
        """Return where the robot would scan on a path from its place, but for the scan at its end.

        It does so after every `scan_every_m` that it has driven. The way to brake, where it has to come to
        rest first, is not taken into account.

        Args:
            path_m: (N, 3) points to which it would drive straight, one after the other; such as `path`.

        Returns:
            (S, 3) float64, in metres, map frame.
        """
        points = np.vstack([self.pose[None, :3], np.asarray(path_m, np.float64).reshape(-1, 3)])
        ends_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        every_m = self.kind.sensor.scan_every_m
        if not ends_m[-1] + self.since_scan_m > every_m:
            return np.zeros((0, 3))
        scans_m = np.arange(every_m - self.since_scan_m, ends_m[-1] * (1.0 - ROUNDING), every_m)
        return np.stack([np.interp(scans_m, ends_m, points[:, axis]) for axis in range(3)], axis=1)

    def no_fly_mask(self) -> np.ndarray | None:
        """Return (X, Y, Z) bool, where the body that it plans for is above the ceiling; None = no ceiling."""
        if self.ceiling is None:
            return None
        grid = self.scenario.grid
        radius = self.kind.robot.planning_radius_m / grid.voxel_size_m
        return no_fly_mask(self.ceiling, grid.shape[2], radius)


def view_of(missions: Missions, mission: int, robot: int) -> RobotView:
    """Return the view of one robot of one mission."""
    state, rules, shape = missions.state, missions.rules, missions.grid.shape
    time_s = float(state.missions[mission]["time_s"])
    own, here = state.robots[mission, robot], (mission, robot)
    heard, rays = state.heard[here], int(rules.params[robot]["rays"])
    world = missions.worlds[mission]
    estimate = None if missions.estimates is None else missions.estimates[here]
    scan_pose = own["scan_pose"] if estimate is None else estimate["scan_pose"]
    exact, params = np.zeros((4, 4)), rules.params[robot]
    landmarks = _landmarks(missions, mission, robot)
    return RobotView(
        robot=robot,
        scenario=missions.scenario,
        time_s=time_s,
        deciding=bool(own["deciding"]),
        under_way=bool(own["under_way"]),
        speed_m_s=float(speed_at(rules.params[robot], own, time_s)),
        since_scan_m=float(since_scan_m(rules.params[robot], own, time_s)),
        pose=read_only(np.array(believed_pose(estimate, params, pose_at(params, own, time_s)))),
        mean=read_only(state.mean[here].reshape(shape)),
        precision=read_only(state.precision[here].reshape(shape)),
        entropy_bits=float(own["entropy_bits"]),
        move_end=MoveEnd.UNDER_WAY if own["under_way"] else list(MoveEnd)[own["move_end"]],
        target=read_only(own["target"].copy()),
        path=read_only(_path_ahead(rules.params[robot], own, estimate, time_s)),
        depth_m=float(own["depth_m"]),
        half_angle_rad=float(own["half_angle_rad"]),
        scan=ScanView(
            read_only(scan_pose.copy()),
            read_only(state.scan_range_m[here][:rays]),
            read_only(state.scan_returned[here][:rays]),
            read_only(state.scan_utility_bits[here][:rays]),
        ),
        teammates={
            mate: teammate_view(heard[mate], bool(is_silent(rules.params[mate], heard[mate], time_s)))
            for mate in range(len(heard))
            if mate != robot
        },
        heard=read_only(heard.copy()),
        gained_bits=float(own["gained_bits"]),
        heard_bits=float(own["heard_bits"]),
        candidates=_candidates(missions, mission, robot),
        ceiling=None if world is None else world.ceiling,
        rules=rules,
        covariance=read_only(exact if estimate is None else estimate["covariance"].copy()),
        fiducials_m=read_only(state.fiducials[mission].copy()),
        landmarks_m=read_only(np.ascontiguousarray(landmarks["believed"])),
        landmarks=read_only(landmarks),
    )


def _landmarks(missions: Missions, mission: int, robot: int) -> np.ndarray:
    """Return the (N,) LANDMARK of a robot's own map, as it knows them; none where it knows where it is."""
    if not missions.state.landmarks.size:
        return np.zeros(0, LANDMARK)
    landmarks = missions.state.landmarks[mission, robot]
    known = landmarks[landmarks["used"]]
    known["place"] = known["believed"]
    return np.asarray(known)


def _candidates(missions: Missions, mission: int, robot: int) -> np.ndarray:
    """Return (K, 5) the viewpoints proposed to a robot that decides; none where actions are others."""
    state = missions.state
    if not state.candidates.size or not state.robots[mission, robot]["deciding"]:
        return read_only(np.zeros((0, 5)))
    candidates = state.candidates[mission, robot]
    return read_only(candidates["viewpoint"][candidates["kind"] != Kind.NONE])


def _path_ahead(params: np.void, own: np.void, estimate: np.void | None, time_s: float) -> np.ndarray:
    """Return (N, 3) where a robot means to drive, whatever will stop it."""
    if own["deciding"] and not own["under_way"]:
        return np.zeros((0, 3))
    if own["waypoints"] == 0:
        return own["target"][None, :3].copy()
    passed = place_at(params, own, time_s)[3]
    ahead = own["path"][passed : own["waypoints"]].copy()
    for corner in ahead:
        corner[:] = believed_point(estimate, (float(corner[0]), float(corner[1]), float(corner[2])))
    return ahead


def teammate_view(heard: np.void, silent: bool) -> TeammateView:
    """Return what is known of a teammate, of which HEARD was heard, and which may count as silent now."""
    announced = np.zeros(7) if silent else heard["announced"].copy()
    return TeammateView(
        heard_s=float(heard["heard_s"]),
        pose=read_only(heard["pose"].copy()),
        announced_s=-1.0 if silent else float(heard["announced_s"]),
        viewpoint=read_only(announced[:5]),
        depth_m=float(announced[5]),
        half_angle_rad=float(announced[6]),
        silent=silent,
    )


def read_only(array: np.ndarray) -> np.ndarray:
    """Return a view of an array that cannot be written through."""
    view = array.view()
    view.setflags(write=False)
    return view
