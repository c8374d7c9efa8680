"""What eq. 13 of RochaMI is evaluated on: voxels near a robot, its cone, and what it heard of teammates.

Grid units. Candidates are those of viewpoints/gradient_candidates.py; the strategies are in
`rules/mutual_information`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.paths.lattice import new_lattice
from entropy_explore_env.belief.raycast import (
    NONE_BEHIND,
    OPEN_END,
    STOP_AT_COVERED,
    Crossing,
    Line,
    cast_ray,
    longest_crossing,
)
from entropy_explore_env.belief.visibility import CONE, in_cone, mark_cones, visible_bits
from entropy_explore_env.belief.voxel_index import flat_index
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel, record_type
from entropy_explore_env.frontiers.knowledge import announced_cone, belief_of
from entropy_explore_env.robots.knowledge import RobotKnowledge
from entropy_explore_env.robots.motion import distance_to_teammate, line_believed_blocked
from entropy_explore_env.settings.ending import gaussian_entropy_bits
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.viewpoints.gradient_candidates import gradient_candidates

INTERFERENCE = 0.5
"""η, for each teammate in the candidate's cone."""
_OVERLAP_SCALE = 0.1
"""ξ, as a share of what the robot's cone would hold if nothing were known in it."""
_LEAST_RADIUS_M = 0.5
"""Lower bound of the radius within which candidates lie, which is r̂ of the latest scan or the reach."""
MATE = record_type([("begin", "f8", (3,)), ("end", "f8", (3,)), ("touching", "f8")])
"""Where a teammate was heard to be, and to drive to, in grid units; `touching`: sum of the two radii."""


class Factors(NamedTuple):
    """Parameters of eq. 13."""

    distance_cost: float
    """κ."""
    scale_bits: float
    """ξ of eq. 12."""
    known_precision: float
    """1/σ² of a voxel that counts as known."""


class Body(NamedTuple):
    """The robot that chooses, and scratch space for lines from where it is."""

    position: tuple[float, float, float]
    neighbourhood: float
    """Radius within which candidates lie."""
    radius: float
    footprint: np.ndarray
    """(B, 3) int64 index offsets of the voxels that it touches."""
    crossing: Crossing


class Team(NamedTuple):
    """What the robot heard of its teammates."""

    mates: np.ndarray
    """(M,) MATE."""
    marks: np.ndarray
    """(V,) uint8, 1 for the voxels that their cones cover."""


@inlined_kernel
def _fits(belief, footprint, place):
    """Return whether a body touches nothing believed covered, nor the boundary."""
    size = belief.size
    for offset in footprint:
        i, j, k = int(place[0]) + offset[0], int(place[1]) + offset[1], int(place[2]) + offset[2]
        if not (0 <= i < size[0] and 0 <= j < size[1] and 0 <= k < size[2]):
            return False
        if belief.mean[flat_index(size, i, j, k)] > STOP_AT_COVERED:
            return False
    return True


@lean_kernel
def reachability(belief, body, end):
    """Return ρ: 1 - max μ of the voxels on the straight line; 0 where the body would touch something.

    The voxel at its end does not count. So an unknown voxel is worth as much as the known one before it:
    which of them has the gradient of a frontier depends only on the direction of the backward difference.

    Args:
        belief: A Belief.
        body: A Body.
        end: (x, y, z) of the candidate.
    """
    mean, size, begin, crossing = belief.mean, belief.size, body.position, body.crossing
    x, y, z = end[0] - begin[0], end[1] - begin[1], end[2] - begin[2]
    length = math.sqrt(x * x + y * y + z * z)
    if length <= 0.0:
        return 1.0
    if not _fits(belief, body.footprint, end):
        return 0.0
    if line_believed_blocked(mean, size, body.footprint, body.radius, begin, end, crossing):
        return 0.0
    line = Line(begin, (x / length, y / length, z / length), length)
    _, n, _ = cast_ray(mean, size, line, STOP_AT_COVERED, OPEN_END, NONE_BEHIND, crossing)
    covered = 0.0
    for step in range(1, n - 1):
        covered = max(covered, mean[crossing.voxels[step]])
    return 1.0 - covered


@inlined_kernel
def _teammate_on_line(mates, begin, end, length):
    """Return whether a teammate stands or drives on a straight line."""
    if length <= 0.0:
        return False
    direction = ((end[0] - begin[0]) / length, (end[1] - begin[1]) / length, (end[2] - begin[2]) / length)
    for mate in mates:
        if mate.touching > 0.0:
            frm, to = (mate.begin[0], mate.begin[1], mate.begin[2]), (mate.end[0], mate.end[1], mate.end[2])
            if distance_to_teammate(begin, direction, length, frm, to, mate.touching) < length:
                return True
    return False


@lean_kernel
def best_candidate(candidates, order, belief, body, team, cone, factors):
    """Return the candidate with the greatest value of eq. 13, of those whose gain is above 0.

    Candidates come in the order of their values for λ = ρ = η = 1: the first one whose bound is not above the
    best value so far ends the search, so that λ is computed for few of them.

    Args:
        candidates: (K,) CANDIDATE.
        order: (K,) int64.
        belief: A Belief.
        body: A Body.
        team: A Team.
        cone: A CONE with r̂ and α̂; its apex and gaze are overwritten.
        factors: Factors.

    Returns:
        Its number; -1 if no candidate has a gain above 0.
    """
    steepest, best, found = 0.0, -math.inf, -1
    for candidate in candidates:
        steepest = max(steepest, candidate.steepness)
    for number in order:
        candidate = candidates[number]
        cost = factors.distance_cost * candidate.distance / body.neighbourhood
        gain = candidate.steepness / steepest
        if gain - cost <= best:
            break
        end = (candidate.place[0], candidate.place[1], candidate.place[2])
        gain *= reachability(belief, body, end)
        if gain <= 0.0 or gain - cost <= best:
            continue
        if len(team.mates) > 0:
            if _teammate_on_line(team.mates, body.position, end, candidate.distance):
                continue
            _place_cone(cone, candidate)
            for mate in team.mates:
                to = mate.end[0] - cone.apex[0], mate.end[1] - cone.apex[1], mate.end[2] - cone.apex[2]
                if in_cone(cone, to[0], to[1], to[2]):
                    gain *= INTERFERENCE
            if gain - cost <= best:
                continue
            known = factors.known_precision
            _, shared = visible_bits(cone, belief.size, belief.precision, known, team.marks)
            gain *= math.exp(-shared / factors.scale_bits)
        if gain - cost > best and gain > 0.0:
            best, found = gain - cost, number
    return found


@inlined_kernel
def _place_cone(cone, candidate):
    """Put the cone at the candidate, along its gaze."""
    level = math.cos(candidate.pitch)
    cone.gaze[0], cone.gaze[1] = math.cos(candidate.yaw) * level, math.sin(candidate.yaw) * level
    cone.gaze[2] = -math.sin(candidate.pitch)
    for axis in range(3):
        cone.apex[axis] = candidate.place[axis]


class Neighbourhood:
    """Finds the best viewpoint of eq. 13 near a robot; memory is shared by the robots of a mission."""

    def __init__(
        self, coordinated: bool, distance_cost: float, scenario: Scenario, rng: np.random.Generator
    ) -> None:
        """Begin a mission.

        Args:
            coordinated: Whether λ, η and ρ use what teammates announce.
            distance_cost: κ.
            scenario: Of the mission.
            rng: Decides between equal voxels.
        """
        self._coordinated, self._distance_cost, self._rng = coordinated, distance_cost, rng
        grid = scenario.grid
        self._footprints = [
            new_lattice(
                grid.shape, kind.robot.planning_radius_m / grid.voxel_size_m, scenario.layer_of(kind.robot)
            ).footprint
            for kind in scenario.kinds
        ]
        longest = longest_crossing(*grid.shape, math.inf, 1)
        self._crossing = Crossing(np.zeros(longest, np.int32), np.zeros(longest, np.int64))
        self._marks = np.zeros(grid.voxels, np.uint8)
        sigma = scenario.ending.sigma_end
        self._known_precision = float(sigma**-2)
        unknown_bits = gaussian_entropy_bits(scenario.sigma_prior) - gaussian_entropy_bits(sigma)
        self._unknown_bits = max(unknown_bits, 0.0)

    def best(self, view: RobotKnowledge) -> np.ndarray | None:
        """Return the viewpoint (5,) of eq. 13, map frame; None if no candidate has a gain above 0."""
        grid, robot = view.scenario.grid, view.kind.robot
        edge, origin = grid.voxel_size_m, np.asarray(grid.origin_m)
        position = grid.in_grid_units(view.pose)[:3]
        depth_m = max(view.depth_m, _LEAST_RADIUS_M)
        radius = min(depth_m, robot.reach_m, float(grid.size_m.sum())) / edge
        layer = view.scenario.layer_of(robot)
        candidates = gradient_candidates(view.precision, self._known_precision, position, radius, layer)
        if len(candidates) == 0:
            return None
        x, y, z = position.tolist()
        footprint = self._footprints[view.robot % len(self._footprints)]
        cone, scale_bits = self._own_cone(view, depth_m / edge)
        best = best_candidate(
            candidates,
            self._order(candidates, radius),
            belief_of(view),
            Body((x, y, z), radius, float(robot.planning_radius_m / edge), footprint, self._crossing),
            Team(self._heard(view), self._marks),
            cone,
            Factors(self._distance_cost, scale_bits, self._known_precision),
        )
        if best < 0:
            return None
        chosen = candidates[best]
        return np.array([*(origin + chosen["place"] * edge), chosen["yaw"], chosen["pitch"]])

    def _order(self, candidates: np.ndarray, radius: float) -> np.ndarray:
        """Return the (K,) candidates by the upper bound of their value, highest first; ties at random."""
        most = candidates["steepness"] / candidates["steepness"].max()
        if self._distance_cost > 0.0:
            most = most - self._distance_cost * candidates["distance"] / radius
        shuffled = self._rng.permutation(len(candidates))
        return shuffled[np.argsort(-most[shuffled], kind="stable")]

    def _own_cone(self, view: RobotKnowledge, depth: float) -> tuple[np.ndarray, float]:
        """Return the robot's cone, without an apex yet, and ξ, a share of the bits that it could hold."""
        sensor = view.kind.sensor
        widest = 0.5 * sensor.angular_step_rad * math.hypot(sensor.columns - 1, sensor.rows - 1)
        cone = np.zeros(1, CONE)
        cosine = math.cos(view.half_angle_rad or min(widest, math.pi))  # before the first scan the widest ray
        cone["radius"], cone["cosine"] = depth, cosine
        voxels = 2.0 / 3.0 * math.pi * depth**3 * (1.0 - cosine)
        return cone[0], max(_OVERLAP_SCALE * voxels * self._unknown_bits, 1e-9)

    def _heard(self, view: RobotKnowledge) -> np.ndarray:
        """Return the teammates that the robot has heard, (M,) MATE, and mark the voxels of their cones."""
        grid = view.scenario.grid
        mates = [number for number, mate in view.teammates.items() if mate.heard_s >= 0.0]
        if not self._coordinated or not mates:
            return np.zeros(0, MATE)
        heard, cones = np.zeros(len(mates), MATE), []
        self._marks[:] = 0
        own_m = view.kind.robot.body_radius_m
        for place, number in enumerate(mates):
            mate = view.teammates[number]
            under_way = mate.announced_s >= mate.heard_s
            touching_m = own_m + view.scenario.kind_of(number).robot.body_radius_m
            heard[place]["begin"] = grid.in_grid_units(mate.pose)[:3]
            heard[place]["end"] = grid.in_grid_units(mate.viewpoint if under_way else mate.pose)[:3]
            heard[place]["touching"] = touching_m / grid.voxel_size_m
            if mate.announced_s >= 0.0 and mate.depth_m > 0.0:
                cones.append(announced_cone(grid, mate))
        mark_cones(np.array(cones, CONE), grid.shape, self._marks)
        return heard
