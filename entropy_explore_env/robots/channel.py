"""The channel: which measurements of a scan are worth sending (Rocha04, eq. 43), and what it costs.

One measurement is a 3-D vector from the sensor to what it saw, three 32-bit numbers: 96 bits. Every
message opens with its sender's pose, five numbers: 160 bits. An announcement adds a viewpoint
(position, yaw, pitch) with r̂ and α̂ (RochaMI), seven numbers: 384 bits in all. A summary of a map costs
the bits of its bytes (`map_summary`). Where robots drift, each batch and each summary carries the covariance
of its sender's pose, ten numbers: 320 bits more. Where robots send by need each message carries a receipt for
each teammate, the number of the latest message that was heard from it and flags for 32 before it: 48 bits;
and a batch may hold measurements of earlier scans, each of which adds its pose.

A broadcast is charged once to its sender and once to each teammate that hears it. What reaches whom is a
matter of distance, of free sight through the true world, or of a signal that walls weaken.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.raycast import (
    NEVER_STOP,
    NONE_BEHIND,
    OPEN_END,
    STOP_AT_COVERED,
    TICKS,
    Crossing,
    Line,
    cast_ray,
)
from entropy_explore_env.codes import Coded
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.randomness import draw_uniform

BITS_PER_BATCH = 160
BITS_PER_ANNOUNCEMENT = 384
BITS_PER_COVARIANCE = 320
_I_MIN_GAIN = 0.1
"""How much a scan changes ln I_min, at most."""
_LEAST_I_MIN_BITS = 1e-6
"""So low that it forbids nothing, and so high that it is back within some dozen scans."""


class Delivery(Coded):
    """What became of a message on its way to one teammate; the value is a sentence for people."""

    HEARD = "The message arrives, at once or after the channel's delay."
    OUT_OF_RANGE = "The teammate was out of reach when it was sent: too far away, or behind walls."
    LOST = "The message was lost by chance."


_HEARD, _OUT_OF_RANGE, _LOST = (delivery.code for delivery in Delivery)
_NEAREST_M = 0.01
"""Of the path loss, which is infinite at no distance."""


class Air(NamedTuple):
    """What messages pass through."""

    occupied: np.ndarray
    """(V,) float32 true coverage."""
    crossing: Crossing
    """Scratch space for a line through all of the workspace."""


@lean_kernel
def edges_in_walls(air, size, start, finish):
    """Return how much of the straight line between two points is in solid voxels, in grid units.

    The same from either end. Where the line only touches a voxel it is not in it.
    """
    if finish < start:
        start, finish = finish, start
    x, y, z = finish[0] - start[0], finish[1] - start[1], finish[2] - start[2]
    length = math.sqrt(x * x + y * y + z * z)
    if length <= 0.0:
        return 0.0
    line = Line(start, (x / length, y / length, z / length), length)
    _, n, _ = cast_ray(air.occupied, size, line, NEVER_STOP, OPEN_END, NONE_BEHIND, air.crossing)
    within, ends = 0.0, length * TICKS
    for step in range(n):
        if air.occupied[air.crossing.voxels[step]] > STOP_AT_COVERED:
            leaves = float(air.crossing.entered[step + 1]) if step + 1 < n else ends
            within += max(leaves - air.crossing.entered[step], 0.0) / TICKS
    return within


@lean_kernel
def path_loss_db(apart_m, exponent, wall_loss_db_per_m, walls_m):
    """Return what the way beyond the first metre costs: see `settings.channel.Signal`."""
    return 10.0 * exponent * math.log10(max(apart_m, _NEAREST_M)) + wall_loss_db_per_m * walls_m


@lean_kernel
def select_measurements(utility, burst, i_min_bits, order):
    """Choose the measurements that a robot sends (Rocha04, eq. 43), the most useful first.

    At most `burst`; fewer only if all those with at least `i_min_bits` are in; nothing left out is
    more useful than something sent. Equal utilities go by ray number.

    Args:
        burst: Most measurements.
        i_min_bits: Least utility.
        order: (R,) int64, its first places are filled with the chosen rays.

    Returns:
        How many were chosen.
    """
    most, chosen = min(burst, len(utility)), 0
    for ray in range(len(utility)):
        bits = utility[ray]
        if bits < i_min_bits or most == 0 or (chosen == most and bits <= utility[order[most - 1]]):
            continue
        chosen = min(chosen + 1, most)
        place = chosen - 1
        while place > 0 and bits > utility[order[place - 1]]:
            order[place] = order[place - 1]
            place -= 1
        order[place] = ray
    return chosen


@lean_kernel
def steered_i_min(i_min_bits, utility, burst, fill):
    """Return I_min after a scan, so that a share of the burst is filled with what is most useful over time.

        ln I_min ← ln I_min + 0.1 · (min(m / (fill · burst), 2) - 1)

    with m the measurements of the scan that reach I_min: it rests where fill · burst of them do on
    average, so that rich scans fill the burst and poor ones send little, and falls as the map becomes
    known (what Rocha04, sect. 5.1.1, leaves to further work).

    Args:
        i_min_bits: I_min at the scan, > 0.
        burst: Most measurements of a batch, ≥ 1.
        fill: Share of it, above 0; above 1, poor scans fill it, too.
    """
    reached = 0
    for bits in utility:
        if bits >= i_min_bits:
            reached += 1
    excess = min(reached / (fill * burst), 2.0) - 1.0
    return max(i_min_bits * math.exp(_I_MIN_GAIN * excess), _LEAST_I_MIN_BITS)


@lean_kernel
def draw_delivery(apart_m, range_m, loss_probability, rng):
    """Return whether a message reaches a teammate: the code of a Delivery.

    `rng` is of the sender, and drawn from only if a loss is possible.
    """
    lost = loss_probability > 0.0 and draw_uniform(rng) < loss_probability
    if apart_m > range_m:
        return _OUT_OF_RANGE
    return _LOST if lost else _HEARD
