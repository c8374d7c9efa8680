"""What is kept of each robot of an Explorer, and its view of the map as strategies read it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from entropy_explore_env.belief.measurement_model import Return
from entropy_explore_env.explorer.workspace import Fused, Workspace
from entropy_explore_env.missions.view import RobotView, read_only, teammate_view
from entropy_explore_env.robots.knowledge import ScanView
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.robots.rotations import turned_by


@dataclass
class Seat:
    """What is kept of a robot; poses are in the canvas's frame."""

    target: np.ndarray | None = None
    """(5,) the viewpoint that was chosen last; None = none was."""
    scan_pose: np.ndarray | None = None
    """(5,) where its latest scan was taken; None = since then it was not heard of."""
    ranges_m: np.ndarray = field(default_factory=lambda: np.zeros(0))
    returned: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int8))
    bits: np.ndarray = field(default_factory=lambda: np.zeros(0))
    """(R,) that its latest scan brought; (1,) what a map brought that was set since; 0 once they counted."""
    depth_m: float = 0.0
    half_angle_rad: float = 0.0
    gained_bits: float = 0.0
    heard_bits: float = 0.0
    due_s: float = 0.0
    """When it should be done with its latest goal."""
    here: bool = True
    """Whether its pose was given at the latest call."""

    def note_map(self, gained_bits: float, heard_bits: float) -> None:
        """Note what a new map brought, in view of its target and elsewhere: as if it had scanned there."""
        self.scan_pose, self.bits = None, np.array([gained_bits])
        self.gained_bits += gained_bits
        self.heard_bits += heard_bits

    def note_scan(self, pose: np.ndarray, ranges_m: np.ndarray, max_range_m: float, fused: Fused) -> None:
        """Note a scan of its own."""
        measured = np.nan_to_num(ranges_m, posinf=max_range_m) > 0.0
        self.scan_pose, self.bits, self.ranges_m = pose.copy(), fused.bits, np.where(measured, ranges_m, 0.0)
        hits = np.where(ranges_m < max_range_m, Return.HIT, Return.FREE)
        self.returned = np.where(measured, hits, Return.NOTHING).astype(np.int8)
        self.depth_m, self.half_angle_rad = fused.depth_m, fused.half_angle_rad
        self.gained_bits += fused.total_bits

    def count_bits(self) -> None:
        """Note that the strategy has decided by these bits, so that the next decision does without them."""
        self.bits = np.zeros_like(self.bits)

    def turn(self, yaw_rad: float) -> None:
        """Turn its poses into another canvas's frame."""
        for name in ("target", "scan_pose"):
            if getattr(self, name) is not None:
                setattr(self, name, turned_by(getattr(self, name), yaw_rad))


def view_of_seat(
    workspace: Workspace,
    seats: list[Seat],
    heard: np.ndarray,
    robot: int,
    pose: np.ndarray,
    moment: tuple[float, MoveEnd, float],
) -> RobotView:
    """Return what a robot of an Explorer knows, in the form of missions.

    Args:
        workspace: Where it is.
        seats: (A,) of the team.
        heard: (A,) HEARD, the same for all: each robot's latest pose and announcement.
        robot: Its number.
        pose: (5,) where it is.
        moment: (time_s, move_end, entropy_bits): now, how its latest drive ended, entropy of the map.
    """
    time_s, move_end, entropy_bits = moment
    seat, canvas = seats[robot], workspace.canvas
    scan_pose = pose if seat.scan_pose is None else seat.scan_pose
    under_way = move_end is MoveEnd.UNDER_WAY
    target = pose if seat.target is None else seat.target
    told = heard.copy()
    for mate, other in enumerate(seats):
        if mate == robot:
            told[mate]["heard_s"] = told[mate]["announced_s"] = -1.0
        elif not other.here:
            told[mate]["announced_s"] = -1.0
    return RobotView(
        robot=robot,
        scenario=workspace.scenario,
        time_s=time_s,
        deciding=True,
        under_way=under_way,
        speed_m_s=0.0,
        since_scan_m=float(np.linalg.norm(pose[:3] - scan_pose[:3])) if under_way else 0.0,
        pose=read_only(pose),
        covariance=read_only(np.zeros((4, 4))),
        mean=read_only(canvas.mean),
        precision=read_only(canvas.precision),
        entropy_bits=entropy_bits,
        move_end=move_end,
        target=read_only(target.copy()),
        path=read_only(target[None, :3].copy() if under_way else np.zeros((0, 3))),
        depth_m=seat.depth_m,
        half_angle_rad=seat.half_angle_rad,
        scan=ScanView(*map(read_only, (scan_pose.copy(), seat.ranges_m, seat.returned, seat.bits))),
        teammates={
            mate: teammate_view(told[mate], not other.here and bool(told[mate]["heard_s"] >= 0.0))
            for mate, other in enumerate(seats)
            if mate != robot
        },
        heard=read_only(told),
        gained_bits=seat.gained_bits,
        heard_bits=seat.heard_bits,
        candidates=read_only(np.zeros((0, 5))),
        ceiling=None,
        rules=workspace.rules,
    )
