"""Motion: a drive that ends at rest, stopped short by obstacles and teammates' bodies.

Its path is a straight line, or a polyline that is driven without stopping at its corners. Lengths are in
metres where the name says so, else in grid units (voxel edges); times are in seconds. Every robot owns the
tube that its body sweeps until it arrives, and others stop before it. A robot that changes its mind under way
can always come to rest in the tube that it owns. So bodies never overlap, whatever the timing.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from entropy_explore_env.belief.raycast import (
    NONE_BEHIND,
    OBSTACLE,
    ONE_BEHIND,
    OPEN,
    OPEN_END,
    STOP_AT_COVERED,
    TICKS,
    Line,
    cast_ray,
)
from entropy_explore_env.belief.voxel_index import flat_index
from entropy_explore_env.codes import Coded
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel


class MoveEnd(Coded):
    """Why a drive ended where it did; the value is a sentence for people."""

    ARRIVED = "The robot reached its viewpoint."
    OBSTACLE = "A solid voxel was in the way: the robot stands in the last voxel in which its body fits."
    GROUND = "The terrain was in the way: the robot stands in the last voxel in which its body fits."
    CEILING = "The ceiling was in the way: the robot stands in the last voxel below it on its way."
    WALL = "The workspace ends there: the robot stands in its last voxel on the way."
    TEAMMATE = "A teammate's body, or the path that it still has to drive, was in the way."
    NO_PATH = "No path to the viewpoint was known: the robot stands as near to it as it knew to get."
    CORNERS = "The path had more corners than a drive may have: the robot stands at the last of them."
    SEEN = "A scan under way showed that the rest of the path is blocked: the robot stands where it was."
    UNDER_WAY = "The drive goes on: the robot decides again without stopping."
    FAILED = "A fault stopped the robot where it was."
    EDGE = "The ground ends there: the robot stands in the last voxel in which all of it is carried."

    @property
    def blocked(self) -> bool:
        """Whether something that does not move was in the way: the same drive would end there again."""
        return self in _BLOCKED


_BLOCKED = frozenset(
    {MoveEnd.OBSTACLE, MoveEnd.GROUND, MoveEnd.CEILING, MoveEnd.WALL, MoveEnd.EDGE, MoveEnd.NO_PATH}
)
_ARRIVED, _WALL = MoveEnd.ARRIVED.code, MoveEnd.WALL.code
_OBSTACLE, _GROUND, _CEILING = MoveEnd.OBSTACLE.code, MoveEnd.GROUND.code, MoveEnd.CEILING.code
_ENDS_AT = (_ARRIVED, _OBSTACLE, _GROUND, _CEILING, MoveEnd.EDGE.code)
"""How a drive ends at each Collision."""
_TOUCH = 1e-6
"""Bodies stop this far apart, in voxel edges, so that rounding cannot make them overlap."""
_HALVINGS = 60


@lean_kernel
def driving_time(length_m, max_speed_m_s, acceleration_m_s2):
    """Return the seconds from rest to rest: 2√(L/a) below L = v²/a, else L/v + v/a."""
    if length_m < max_speed_m_s * max_speed_m_s / acceleration_m_s2:
        return 2.0 * math.sqrt(length_m / acceleration_m_s2)
    return length_m / max_speed_m_s + max_speed_m_s / acceleration_m_s2


class SpeedProfile(NamedTuple):
    """The speed on a path: as fast as the limits allow, from the speed at its start to rest at its end.

    Corners of the path cost nothing. A drive that begins at the speed v = a·lead_s is the rest of one from
    rest to rest that is v²/2a longer and began `lead_s` earlier. Where a robot turns too sharply to keep its
    speed (missions/redecision.py), `lead_s` is negative: from v = -a·lead_s it brakes to rest on the first
    v²/2a of the path, and drives what is left of it from rest to rest.
    """

    length_m: float
    """At least v²/2a, up to rounding."""
    lead_s: float
    """0 = the drive begins at rest."""
    max_speed_m_s: float
    acceleration_m_s2: float


@inlined_kernel
def _run_up_m(profile):
    """Return ±v²/2a: by how much a drive from rest to rest is longer; negative if the robot brakes first."""
    return 0.5 * profile.acceleration_m_s2 * profile.lead_s * abs(profile.lead_s)


@inlined_kernel
def _from_rest_to_rest(profile):
    """Return (length, duration, time of speeding up) of the drive from rest to rest that holds this one."""
    length_m = max(profile.length_m + _run_up_m(profile), 0.0)
    duration = driving_time(length_m, profile.max_speed_m_s, profile.acceleration_m_s2)
    return length_m, duration, min(profile.max_speed_m_s / profile.acceleration_m_s2, duration / 2.0)


@lean_kernel
def duration_of(profile):
    """Return the seconds that a drive takes."""
    _, duration, _ = _from_rest_to_rest(profile)
    return duration - profile.lead_s


@lean_kernel
def driven_share(elapsed_s, profile):
    """Return the share in [0, 1] of a drive that is behind the robot `elapsed_s` after its start."""
    length_m, duration, ramp = _from_rest_to_rest(profile)
    acceleration_m_s2 = profile.acceleration_m_s2
    since_rest_s = elapsed_s + profile.lead_s
    if since_rest_s >= duration or profile.length_m <= 0.0:
        return 1.0
    if since_rest_s <= ramp:  # before it is at rest it brakes
        driven_m = 0.5 * acceleration_m_s2 * since_rest_s * abs(since_rest_s)
    elif since_rest_s >= duration - ramp:
        left = duration - since_rest_s
        driven_m = length_m - 0.5 * acceleration_m_s2 * left * left
    else:
        driven_m = acceleration_m_s2 * ramp * (since_rest_s - 0.5 * ramp)
    return min(max((driven_m - _run_up_m(profile)) / profile.length_m, 0.0), 1.0)


@lean_kernel
def speed_after(elapsed_s, profile):
    """Return the speed on the path, in m/s, `elapsed_s` after the drive's start; 0 at its end and later."""
    _, duration, ramp = _from_rest_to_rest(profile)
    since_rest_s = elapsed_s + profile.lead_s
    if since_rest_s >= duration or profile.length_m <= 0.0:
        return 0.0
    if since_rest_s < 0.0:
        return profile.acceleration_m_s2 * -since_rest_s
    return profile.acceleration_m_s2 * min(since_rest_s, ramp, duration - since_rest_s)


@lean_kernel
def time_after(driven_m, profile):
    """Return the seconds from the start until `driven_m` of a drive are driven: see `driven_share`."""
    length_m, duration, ramp = _from_rest_to_rest(profile)
    acceleration_m_s2 = profile.acceleration_m_s2
    ramp_m = 0.5 * acceleration_m_s2 * ramp * ramp
    since_rest_m = driven_m + _run_up_m(profile)
    if since_rest_m < 0.0:
        return -math.sqrt(-2.0 * since_rest_m / acceleration_m_s2) - profile.lead_s
    if since_rest_m <= ramp_m:
        return math.sqrt(2.0 * since_rest_m / acceleration_m_s2) - profile.lead_s
    if since_rest_m >= length_m - ramp_m:
        left_s = math.sqrt(2.0 * max(length_m - since_rest_m, 0.0) / acceleration_m_s2)
        return duration - left_s - profile.lead_s
    return ramp + (since_rest_m - ramp_m) / profile.max_speed_m_s - profile.lead_s


@lean_kernel
def turning_time(yaw, pitch, new_yaw, new_pitch, turn_rate_rad_s):
    """Return the seconds to turn the gaze, yaw and pitch at once, each the short way round."""
    turn = abs(new_yaw - yaw) % (2.0 * math.pi)
    turn = min(turn, 2.0 * math.pi - turn)
    return max(turn, abs(new_pitch - pitch)) / turn_rate_rad_s


@lean_kernel
def line_believed_blocked(mean, size, footprint, radius, start, finish, crossing):
    """Return whether a body that drives on a line would touch something that is believed covered.

    The voxel that it is in does not count, nor do voxels that its body touches there keep it from leaving:
    voxels that the body reaches into already count as free if they are not covered themselves.

    Args:
        footprint: (B, 3) int64, offsets of the voxels that a body touches, by axis; empty = its own.
        radius: Of the body, in grid units.
    """
    x, y, z = finish[0] - start[0], finish[1] - start[1], finish[2] - start[2]
    length = math.sqrt(x * x + y * y + z * z)
    if length <= 0.0:
        return False
    line = Line(start, (x / length, y / length, z / length), length)
    _, n, end = cast_ray(mean, size, line, STOP_AT_COVERED, OPEN_END, NONE_BEHIND, crossing)
    if end == OBSTACLE:
        return True
    leaving = 0.0
    for step in range(n):
        if step > 0 and crossing.entered[step] < leaving:
            continue
        touches, voxel = False, crossing.voxels[step]
        for offset in footprint:
            i = voxel // (size[1] * size[2]) + offset[0]
            j, k = voxel // size[2] % size[1] + offset[1], voxel % size[2] + offset[2]
            if 0 <= i < size[0] and 0 <= j < size[1] and 0 <= k < size[2]:
                touches = touches or mean[flat_index(size, i, j, k)] > STOP_AT_COVERED
        if touches and step > 0:
            return True
        if touches:
            leaving = radius * TICKS
    return False


@lean_kernel
def free_distance(collision, size, line, finish, crossing):
    """Return how far a body can drive on a line before something solid.

    Args:
        collision: (V,) float32, a Collision each: above ½ the body does not fit.
        finish: (x, y, z), where the drive is to end, the line's end.

    Returns:
        (distance, code): in grid units (to the middle of the last voxel's crossing, if blocked)
        and the code of a MoveEnd.
    """
    if line.length <= 0.0:
        return 0.0, _ARRIVED
    # A little farther, and the last voxel by itself: a body on a face or an edge is in the
    # voxel above it, through which the line need not go, and which must be free, too.
    farther = Line(line.start, line.direction, line.length + _TOUCH)
    at, n, end = cast_ray(collision, size, farther, STOP_AT_COVERED, OPEN_END, ONE_BEHIND, crossing)
    crossed, entered = crossing.voxels, crossing.entered
    code = _WALL
    if end == OBSTACLE:
        n -= 1
        code = _ENDS_AT[int(collision[crossed[n]])]
    elif end == OPEN:
        x, y, z = min(int(finish[0]), size[0] - 1), min(int(finish[1]), size[1] - 1), int(finish[2])
        voxel = flat_index(size, x, y, min(z, size[2] - 1))
        if voxel == crossed[0] or collision[voxel] <= STOP_AT_COVERED:
            return line.length, _ARRIVED
        at, code = line.length, _ENDS_AT[int(collision[voxel])]
    last = n - 1
    while last > 0 and at - entered[last] / TICKS <= _TOUCH:  # a voxel that the line meets at its edge only
        at = entered[last] / TICKS
        last -= 1
    middle = 0.5 * (entered[last] / TICKS + at) if last > 0 else 0.0
    return middle, code


@lean_kernel
def _gap(start, direction, distance, begin, finish):
    """Return the distance between the point `distance` along a line and the segment `begin` to `finish`."""
    along, length = 0.0, 0.0
    for axis in range(3):
        edge = finish[axis] - begin[axis]
        along += (start[axis] + distance * direction[axis] - begin[axis]) * edge
        length += edge * edge
    share = min(max(along / length, 0.0), 1.0) if length > 0.0 else 0.0
    gap = 0.0
    for axis in range(3):
        nearest = begin[axis] + share * (finish[axis] - begin[axis])
        gap += (start[axis] + distance * direction[axis] - nearest) ** 2
    return math.sqrt(gap)


@lean_kernel
def distance_to_teammate(start, direction, distance, begin, finish, touching):
    """Return how far a body can drive before it touches a teammate or the tube that it still sweeps.

    Bodies that touch already may only part.

    The distance from a point on a line to a segment is convex along the line, so bisection finds
    the nearest place and, before it, the first contact.

    Args:
        direction: (x, y, z), a unit vector.
        distance: Wanted distance in grid units.
        begin: (x, y, z), where the teammate is.
        finish: (x, y, z), where its drive ends.
        touching: Sum of the two radii.

    Returns:
        The distance in grid units, at most `distance`.
    """
    apart = touching + _TOUCH
    if _gap(start, direction, 0.5 * distance, begin, finish) - 0.5 * distance > apart + _TOUCH:
        return distance  # no point of the line is nearer than that
    low, high = 0.0, distance
    for _ in range(_HALVINGS):
        third = (high - low) / 3.0
        if _gap(start, direction, low + third, begin, finish) <= _gap(
            start, direction, high - third, begin, finish
        ):
            high -= third
        else:
            low += third
    if _gap(start, direction, low, begin, finish) >= apart:
        return distance
    if _gap(start, direction, 0.0, begin, finish) < apart:
        return distance if low <= _TOUCH else 0.0
    near, high = 0.0, low
    for _ in range(_HALVINGS):
        middle = 0.5 * (near + high)
        if _gap(start, direction, middle, begin, finish) >= apart:
            near = middle
        else:
            high = middle
    return near
