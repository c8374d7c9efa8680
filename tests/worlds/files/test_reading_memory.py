"""Large meshes and point clouds: reading takes memory by what is in the file and by what comes out."""

from __future__ import annotations

import math

import pytest

from entropy_explore_env.worlds.files.process import kept_reader
from entropy_explore_env.worlds.load import load_world
from tests.worlds.surfaces import write_cloud, write_mesh

KIB = 1024
BYTES_OF_A_VOXEL = 1.5
"""One for its label, and some for what is marked at once."""


def read(path, voxel_m, **options):
    """The number of voxels, and the peak memory in bytes of a process that reads nothing else."""
    with kept_reader() as reader:
        world = load_world(path, voxel_m, **options)
        assert reader.cost is not None
        if math.isnan(reader.cost["peak_kib"]):
            pytest.skip("this system does not tell how much memory a process takes")
        return world.occupied.size, KIB * reader.cost["peak_kib"]


@pytest.mark.parametrize(
    ("name", "write", "columns", "rows", "bytes_of_each", "options"),
    [
        ("hills.ply", write_mesh, 501, 301, 1000, {"fill": False}),  # trimesh's edges, normals and indices
        ("hills.pcd", write_cloud, 701, 431, 150, {}),
    ],
)
def test_memory_follows_the_content_and_the_voxels(
    tmp_path, name, write, columns, rows, bytes_of_each, options
):
    path = tmp_path / name
    write(path, 4, 3, 0.1)
    _, least = read(path, 0.1, **options)
    count = write(path, columns, rows, 0.1)
    assert count >= 300_000
    few, coarse = read(path, 0.5, **options)
    many, fine = read(path, 0.06, **options)
    assert few < 1e6 and many > 40e6
    assert coarse - least < bytes_of_each * count
    assert fine - coarse < BYTES_OF_A_VOXEL * many
