"""When a planner gives up a viewpoint, keeps clear, looks far and goes elsewhere: numbers of its rules."""

from __future__ import annotations

MISSED_EDGES = 0.01
"""A drive that ended farther than this from where it should, in voxel edges, was cut short."""
DISAPPOINTING = 0.1
"""Viewpoints are remembered that brought less than this share of what was expected."""
ALIKE_EDGES, ALIKE_RAD = 1.0, 0.1
"""Viewpoints that differ by less are the same to a robot that remembers one."""
FAILED_GAZES = 4
"""Failures of one place; each beyond widens by ALIKE_RAD which gazes there count as alike."""
FORGET_EDGES, REMEMBERED = 6.0, 16
"""How far away from where it was a robot forgets what it could not do, and how much it remembers at most."""
BLOCKED_DECISIONS = 4
"""Decisions during which a robot keeps clear of a teammate that was in its way."""
EDGES = 64
"""Places beyond the end of the ground that a robot remembers."""
CLEAR = 1.1
"""How far it keeps clear, in sums of the two radii."""
DREGS_SHARE = 0.01
"""What bits are worth at least, next to others above the dregs: so that there is a best where all are."""
FAR_EVERY, PATIENCE = 8, 4
"""Decisions on one spot until far places are looked at again, and where straight drives found none."""
TRIED_STOPS = 6
"""Far places of which the first stop is looked at; and gazes at stops that are proposed but not chosen."""
POOR, NOTHING_BITS = 0.02, 1e-6
"""A scan is poor that should bring less than this share of the most bits ever expected; what is nothing."""
STALE = 64
"""Poor scans in a row from one place after which a robot trusts its expectations less, looks further, and
chooses by the plain rate, c = 1, until a scan is not poor."""
STALE_DISAPPOINTING = 0.5
"""As DISAPPOINTING, after so many."""
FURTHER = 8
"""How often it then goes on to the next best far places."""
ELSEWHERE = 16
"""Places that are drawn where nothing is left nearby."""
