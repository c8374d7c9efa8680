"""The numbers of the planner's rules, in one table: what each does, and where it comes from.

Numbers marked "tuned" were chosen on missions in worlds of the train split; those marked "by construction"
follow from the arithmetic or only bound memory and time. What differs from one kind of robot to another is in
`recipe`. Lengths are in voxel edges unless a line says otherwise.
"""

from __future__ import annotations

# Drawing and refining viewpoints within reach
YAW_SPREAD, PITCH_SPREAD = 1.2, 1.5
"""Standard deviation of gazes around the present one, in widths and heights of the field of view (tuned)."""
REFINED_AROUND = 3
"""Number of best viewpoints around which others are drawn (tuned)."""
REFINED_SHRINK = 0.7
"""Factor by which refined viewpoints differ less from one refinement to the next (tuned)."""
REFINED_SHIFT = 0.2
"""Standard deviation by which refined places differ along an axis, in reaches (tuned)."""
PATHS_WITHIN = 1.6
"""Longest path to a place within reach, in reaches: around a corner or two (tuned)."""

# What is predicted where nothing was measured
SOLID_SHARE = 0.25
"""Mean predicted probability to be solid, of what was not measured, from which on imagined rays stop as
predicted (tuned: it lies between offices, whose walls are thin, and all other plans)."""
SOLID_SHARE_IN_VOLUMES = 0.5
"""Mean predicted probability to be solid, of the voxels around a robot in a volume, from which on imagined
rays stop as predicted (tuned: it lies between furnished offices and caves)."""
MOST_PREDICTED_VOXELS = 4_000_000
"""Voxels of the largest volume in which something is predicted (by construction: time and memory)."""
RENEWED_M, RENEWED_DECISIONS = 1.0, 8
"""Metres that a robot moves, and decisions that it makes, until its prediction is renewed (tuned)."""
COURSE_DECISIONS, TO_AND_FRO = 16, 6.0
"""A robot drives to and fro if its way over the last decisions is this many times the diagonal of the box
around its places (tuned: of a robot between two places it is 15)."""

# Far places
FIRST_RADIUS = 3.0
"""Length of the paths that are searched first, in reaches; then twice that, and so on (tuned, for time)."""
FAR_PITCH_RAD = 0.5
"""Standard deviation of the pitch of gazes at far places (tuned)."""
KEEP_GOAL = 1.15
"""Factor by which another viewpoint has to be worth more than the robot's goal to replace it (tuned)."""
FAR_DECISIONS, FAR_DECISIONS_STRAIGHT = 8, 4
"""Decisions on one spot until far places are evaluated again, with `far_below` of 1 and below it (tuned)."""
TRIED_STOPS = 6
"""Far places whose first stop is examined, and gazes at stops that are proposed but not chosen (tuned)."""

# Failures that a robot remembers
DRIVE_TOLERANCE = 0.01
"""A drive that ended farther than this from its target was cut short (by construction: rounding)."""
FAILED_SHARE = 0.1
"""A viewpoint is a failure if its scan brought less than this share of the expected bits (tuned)."""
SAME_PLACE, SAME_GAZE_RAD = 1.0, 0.1
"""Viewpoints that differ by less are the same one to a robot that remembers a failure (tuned)."""
FAILED_GAZES = 4
"""Failures at one place beyond which each further one widens SAME_GAZE_RAD by itself there (tuned)."""
FORGET_DISTANCE, REMEMBERED = 6.0, 16
"""Distance at which a robot forgets a failure (tuned), and the most that it remembers (by construction)."""
REMEMBERED_EDGES = 64
"""Number of places beyond the end of the ground that a robot remembers (by construction)."""

# Teammates in the way
KEEP_CLEAR_DECISIONS = 4
"""Decisions during which a robot keeps clear of a teammate that stopped it (tuned)."""
CLEARANCE = 1.1
"""Distance that it keeps from the teammate's path, in sums of the two radii (tuned)."""

# Gain that counts as little, and what follows from it
LOW_GAIN = 0.02
"""Scans expected to bring less than this share of the most bits ever expected have a low gain (tuned)."""
NO_GAIN_BITS = 1e-6
"""Expected bits up to which a scan brings nothing (by construction: rounding)."""
DEPLETED_SCANS = 64
"""Number of low-gain scans in a row from one place that make a planner DEPLETED (tuned)."""
DEPLETED_FAILED_SHARE = 0.5
"""FAILED_SHARE of a planner that is DEPLETED (tuned)."""
LEAST_WORTH = 0.01
"""Share of its bits that a scan is worth at least where all bits are those of known ground (by construction:
so that there is a best one)."""
RANDOM_VIEWPOINTS = 16
"""Number of viewpoints that a WANDERING robot draws, of which it takes the most trusted one (tuned)."""

# Selecting candidates out of the pool
FAR_SHARE, NEAR_SHARE = 4, 4
"""One in this many candidates, and at least one, may be far; one in this many may be a place within reach
that is worth less than gazes on the spot (tuned)."""
ALIKE_REACH, ALIKE_WIDTH = 0.1, 0.25
"""Viewpoints are alike that are nearer than this, in reaches and in widths of the view (tuned)."""
MOST_COMMON = 0.9
"""Largest share of the voxels of either of two candidates that both may see (tuned)."""
