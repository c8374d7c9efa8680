"""Faults that cannot change what the code does, each with the reason: no test could find them."""

from __future__ import annotations

from typing import NamedTuple


class Equivalent(NamedTuple):
    """One fault."""

    path: str
    """Of the source, from the root of the checkout."""
    function: str
    what: str
    """The statement as it is, and with the fault."""
    reason: str
    """Why both do the same."""


_BELIEF, _MISSIONS = "entropy_explore_env/belief", "entropy_explore_env/missions"
_ROBOTS = "entropy_explore_env/robots"
EQUIVALENT = (
    Equivalent(
        f"{_BELIEF}/elevation.py",
        "_relax",
        "if needed + 1 < together:  ->  if needed - 1 < together:",
        "Sweeps of which the last was the last that is needed are done once more, from the same start.",
    ),
    Equivalent(
        f"{_BELIEF}/landmark_score.py",
        "landmark_score",
        "mean = total / count if count > 0 else 0.0  ->  mean = total / count if count > 0 else 1.0",
        "The mean of no voxels is not read.",
    ),
    Equivalent(
        f"{_BELIEF}/paths/planning.py",
        "_open_exits",
        "i, j, k = (x + offset[0], y + offset[1], z + offset[2])  ->  "
        "i, j, k = (x + offset[0], y + offset[1], z - offset[2])",
        "What a body touches lies as far below it as above.",
    ),
    Equivalent(
        f"{_BELIEF}/paths/planning.py",
        "_passable_moves",
        "inner = 0 < x < size[0] - 1 and 0 < y < size[1] - 1 and (lattice.layer >= 0)  ->  "
        "inner = 1 < x < size[0] - 1 and 0 < y < size[1] - 1 and (lattice.layer >= 0)",
        "One row more takes the slower way, which finds the same.",
    ),
    Equivalent(
        f"{_BELIEF}/paths/planning.py",
        "_passable_moves",
        "inner = 0 < x < size[0] - 1 and 0 < y < size[1] - 1 and (lattice.layer >= 0)  ->  "
        "inner = 0 < x < size[0] - 1 and 1 < y < size[1] - 1 and (lattice.layer >= 0)",
        "One column more takes the slower way, which finds the same.",
    ),
    Equivalent(
        f"{_BELIEF}/paths/planning.py",
        "search_paths",
        "per_cost = _BUCKET_WIDTH ** (-1) / costs.min_per_edge  ->  "
        "per_cost = _BUCKET_WIDTH ** (-2) / costs.min_per_edge",
        "Buckets that are a millionth narrower hold the same costs in the same order.",
    ),
    Equivalent(
        f"{_BELIEF}/paths/string_pulling.py",
        "string_pull",
        "while here < last and filled < len(waypoints):  ->  while here <= last and filled < len(waypoints):",
        "What is behind the last stop is that stop again, and no waypoint is as near.",
    ),
    Equivalent(
        f"{_BELIEF}/map_update.py",
        "fuse_ray",
        "if shrink < _FOLD_BELOW:  ->  if shrink <= _FOLD_BELOW:",
        "Whether a product is folded one voxel earlier does not change the sum of the logarithms.",
    ),
    Equivalent(
        f"{_BELIEF}/map_update.py",
        "expected_utility",
        "if growth > 1.0 / _FOLD_BELOW:  ->  if growth > 1.0 * _FOLD_BELOW:",
        "The product is folded at every voxel, and the sum of the logarithms stays the same.",
    ),
    Equivalent(
        f"{_BELIEF}/map_update.py",
        "expected_utility",
        "if growth > 1.0 / _FOLD_BELOW:  ->  if growth > 2.0 / _FOLD_BELOW:",
        "Whether a product is folded one voxel later does not change the sum of the logarithms.",
    ),
    Equivalent(
        f"{_BELIEF}/paths/planning.py",
        "resume_search",
        "query = _Query(ANY_GOAL, (0, 0, 0), _BUCKET_WIDTH ** (-1) / costs.min_per_edge)  ->  "
        "query = _Query(ANY_GOAL, (1, 0, 0), _BUCKET_WIDTH ** (-1) / costs.min_per_edge)",
        "A search without a goal does not read where the goal is.",
    ),
    Equivalent(
        f"{_BELIEF}/visibility.py",
        "_column_span",
        "if a > _SLACK and root >= 0.0:  ->  if a > _SLACK and root > 0.0:",
        "Bounds that are not narrowed here are narrowed by the loops that follow.",
    ),
    Equivalent(
        f"{_BELIEF}/visibility.py",
        "_column_span",
        "return (0, 0)  ->  return (1, 0)",
        "Both are spans without a layer.",
    ),
    Equivalent(
        f"{_BELIEF}/visibility.py",
        "_column_span",
        "low, high = (max(low, (root - half_b) / a), min(high, -(root + half_b) / a))  ->  "
        "low, high = (max(low, (root - half_b) / a), max(high, -(root + half_b) / a))",
        "Bounds that are not narrowed here are narrowed by the loops that follow.",
    ),
    Equivalent(
        f"{_MISSIONS}/faults.py",
        "next_stop",
        "soonest, soonest_s = (0, math.inf)  ->  soonest, soonest_s = (1, math.inf)",
        "Where the time stays inf no robot stops, and its number is not read.",
    ),
    Equivalent(
        f"{_MISSIONS}/messages.py",
        "next_message",
        "soonest, due_s = (0, math.inf)  ->  soonest, due_s = (1, math.inf)",
        "Where the time stays inf no message is due, and its slot is not read.",
    ),
    Equivalent(
        f"{_MISSIONS}/poses.py",
        "pose_at",
        "shortest = (goal[3] - origin[3] + math.pi) % (2.0 * math.pi) - math.pi  ->  "
        "shortest = (goal[3] - origin[3] - math.pi) % (2.0 * math.pi) - math.pi",
        "Both differ by a whole turn, which the remainder takes away.",
    ),
    Equivalent(
        f"{_MISSIONS}/scoring.py",
        "holds_enough",
        "free += int(truth[voxel] <= 0.5)  ->  free += int(truth[voxel] < 0.5)",
        "No voxel of the truth is half solid.",
    ),
    Equivalent(
        f"{_ROBOTS}/map_tree.py",
        "write_tree",
        "kind = kind_of(tree, region, known == 1, threshold_bits)  ->  "
        "kind = kind_of(tree, region, known == 2, threshold_bits)",
        "A part of what is known is looked through once more, and is found to be known.",
    ),
    Equivalent(
        f"{_ROBOTS}/motion.py",
        "time_after",
        "if since_rest_m < 0.0:  ->  if since_rest_m <= 0.0:",
        "Both formulas give the same time at rest.",
    ),
    Equivalent(
        f"{_ROBOTS}/pose_covariance.py",
        "in_field_of_view",
        "return within_half_view(params, turn, down - pitch) or within_half_view(params, turn + math.pi, "
        "math.pi - down - pitch)  ->  return within_half_view(params, turn, down - pitch) or "
        "within_half_view(params, turn - math.pi, math.pi - down - pitch)",
        "Both differ by a whole turn, which `within_half_view` takes away.",
    ),
    Equivalent(
        f"{_ROBOTS}/range_coder.py",
        "read_change",
        "size = size << 1 | read_bit(coder, contexts + 9 + 8 * bits + place)  ->  "
        "size = size << 1 | read_bit(coder, contexts + 9 + 8 * bits - place)",
        "The reader numbers its contexts in another order: each is still that of one kind of decision.",
    ),
    Equivalent(
        f"{_ROBOTS}/range_sensor.py",
        "measure_ranges",
        "measure_ray(ray, params, scene, start, RayEnd(length, 0, end), covered >= _UNREADABLE, rng)  ->  "
        "measure_ray(ray, params, scene, start, RayEnd(length, 1, end), covered >= _UNREADABLE, rng)",
        "What is measured does not depend on how many voxels were crossed.",
    ),
)
