"""The canvas of an Explorer: maps that grow, move and outgrow it, and the memory that it takes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import entropy_explore_env as eee
from entropy_explore_env.explorer.explorer import Explorer
from tests.explorer.hand_drawn import EDGE_M, START


def test_unknown_margins_are_cropped_and_do_not_matter(seen_from_start):
    wide = np.full((700, 600), -1, np.int8)
    wide[300:420, 250:330] = seen_from_start
    given, cropped = Explorer(voxel_size_m=EDGE_M), Explorer(voxel_size_m=EDGE_M)
    given.set_map(seen_from_start, origin=(0.0, 0.0, 0.0))
    cropped.set_map(wide, origin=(-30.0, -25.0, 0.0))
    assert cropped.map.grid.shape == given.map.grid.shape
    assert np.allclose(given.goal(START).viewpoint, cropped.goal(START).viewpoint, atol=1e-9)


def test_a_map_may_grow_and_move_between_calls(seen_from_start):
    part = np.where(np.arange(120)[:, None] < 25, seen_from_start, -1)
    explorer = Explorer(voxel_size_m=EDGE_M)
    explorer.set_map(part[:30].astype(np.int8), origin=(0.0, 0.0, 0.0))
    before = explorer.map.grid
    larger = np.full((400, 90), -1, np.int8)
    larger[5:125, 7:87] = seen_from_start
    larger[300:320, 5:9] = 0
    explorer.set_map(larger, origin=(-0.5, -0.7, 0.0))
    assert explorer.map.grid != before
    assert int(explorer.map.known.sum()) == int((larger >= 0).sum())
    assert explorer.goal(START) is not None


def outgrown(seen, begin=250):
    """A map that holds another one, and far from it something that no canvas around that one holds."""
    larger = np.full((begin + 50, 260), -1, np.int8)
    larger[130:250, 150:230] = seen
    larger[:9, :9] = larger[begin + 30 : begin + 40, 5:9] = 0
    return larger, (-130 * EDGE_M, -150 * EDGE_M, 0.0)


def test_what_was_blocked_is_remembered_where_the_map_outgrows_its_canvas(seen_from_start):
    explorer = Explorer(voxel_size_m=EDGE_M)
    explorer.set_map(seen_from_start, origin=(0.0, 0.0, 0.0))
    blocked = []
    for begin in (250, 900, 1600):
        goal = explorer.goal(START, ended=eee.MoveEnd.OBSTACLE if blocked else None)
        blocked.append(goal.viewpoint)
        before = explorer.map.grid
        explorer.set_map(*outgrown(seen_from_start, begin))
        assert explorer.map.grid != before
    last = explorer.goal(START, ended=eee.MoveEnd.OBSTACLE).viewpoint
    places = np.array([*blocked, last])[:, :2]
    apart = np.linalg.norm(places[:, None] - places, axis=-1) + np.eye(4)
    assert (apart > 0.5 * EDGE_M).all()


def test_failures_of_the_planner_lie_where_they_did_in_the_larger_canvas(seen_from_start):
    explorer = Explorer("office", voxel_size_m=EDGE_M, robots=1)
    explorer.set_map(seen_from_start, origin=(0.0, 0.0, 0.0))
    explorer.goal(START)
    explorer.set_map(seen_from_start)  # the scan that was expected to bring something brings nothing
    explorer.goal(START)

    def failed():
        grid = explorer._ground.workspace.canvas.grid
        experience = vars(explorer._strategy)["_proposer"]._experience
        assert experience["failures"][0] > 0
        return np.asarray(grid.origin_m) + experience["failed"][0, 0, :3] * EDGE_M

    before = failed()
    explorer.set_map(*outgrown(seen_from_start))
    assert np.allclose(failed(), before)
    assert explorer.goal(START) is not None


_MEMORY = """
import sys
import numpy as np
import entropy_explore_env as eee

def resident():
    return int(open("/proc/self/statm").read().split()[1]) * 4096

def most():
    lines = open("/proc/self/status").read().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM")) * 1024

def play(edge):
    grid = np.full((edge, edge), -1, np.int8)
    grid[10:-10, 10:-10] = 0
    grid[10, 10:-10] = grid[-10, 10:-10] = 100
    grid[edge // 2 :, edge // 2 :] = -1
    explorer = eee.Explorer(sys.argv[1] or None, voxel_size_m=0.05, robots=1)
    pose = np.array([0.015 * edge, 0.015 * edge, 0.0, 0.0, 0.0])
    for wide in (0, edge // 8):
        grid[edge // 2 :, edge // 2 : edge // 2 + wide] = 0
        explorer.set_map(grid)
        assert explorer.goal(pose) is not None
    return explorer

play(200)
before = resident()
explorer = play(2000)
taken = most() - before
print(taken, 2000 * 2000 + 8 * explorer.map.grid.voxels)
"""


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="reads the memory from /proc")
@pytest.mark.parametrize("name", ["", "office"])
def test_memory_stays_below_three_times_the_grid(name):
    """Of what is given, and of the belief, in pages of 4 KiB: one robot by tours, and one by bits."""
    pages = {"NUMPY_MADVISE_HUGEPAGE": "0", "MALLOC_MMAP_THRESHOLD_": str(1 << 20)}
    told = subprocess.run(
        [sys.executable, "-c", _MEMORY, name], env={**os.environ, **pages}, check=True, capture_output=True
    )
    taken, grid = map(int, told.stdout.split())
    assert grid < taken < 3 * grid
