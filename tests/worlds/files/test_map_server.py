"""Floor plans of map_server: the three modes by hand, frames, and files that lead astray."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.proofs.world_samples import YAML, pgm, plan, png
from entropy_explore_env.errors import WorldError
from entropy_explore_env.worlds.files.map_server import labels_of
from entropy_explore_env.worlds.load import load_world
from tests.systems import needs_posix

UNKNOWN, FREE, SOLID = -1, 0, 1
OPAQUE = np.float32(255.0)


def labels(shades, mode, negate=False, free=0.196, occupied=0.65, opacity=None):
    shades = np.array([shades], np.float32)
    clear = np.full(shades.shape, OPAQUE) if opacity is None else np.array([opacity], np.float32)
    return labels_of(shades, clear, mode, negate, free, occupied)[0].tolist()


def test_trinary_by_hand():
    """p = (255 - x)/255: 89 → 0.651, 90 → 0.647, 205 → 0.1961, 206 → 0.192."""
    assert labels([0, 89, 90, 205, 206, 255], "trinary") == [SOLID, SOLID, UNKNOWN, UNKNOWN, FREE, FREE]


def test_negate_by_hand():
    """p = x/255: 49 → 0.192, 50 → 0.1961, 165 → 0.647, 166 → 0.651."""
    found = labels([0, 49, 50, 165, 166, 255], "trinary", negate=True)
    assert found == [FREE, FREE, UNKNOWN, UNKNOWN, SOLID, SOLID]


def test_scale_by_hand():
    """Thresholds 0.2 and 0.6: 1 + 98 (p - 0.2)/0.4 is 49.0 for x = 154 and 51.0 for x = 152."""
    found = labels([255, 210, 154, 152, 110, 0], "scale", free=0.2, occupied=0.6)
    assert found == [FREE, FREE, FREE, SOLID, SOLID, SOLID]
    clear = labels([255, 255, 0], "scale", opacity=[255, 254, 0])
    assert clear == [FREE, UNKNOWN, UNKNOWN]


def test_raw_by_hand():
    for negate in (False, True):
        found = labels([0, 49, 50, 100, 101, 255], "raw", negate=negate)
        assert found == [FREE, FREE, SOLID, SOLID, UNKNOWN, UNKNOWN]


def write(folder, yaml=YAML, image=None, name="plan.pgm"):
    (folder / "map.yaml").write_bytes(yaml)
    if image is not None:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(image)
    return folder / "map.yaml"


def test_the_lower_left_pixel_is_the_first_voxel(tmp_path):
    shades = np.full((7, 11), 254, np.uint8)
    shades[6, 0] = 0  # lower left
    shades[0, 10] = 0  # upper right
    shades[5, 2] = 205  # unknown: p = 0.196 is not below 0.196
    world = load_world(write(tmp_path, image=pgm(shades)))
    assert world.grid.shape == (11, 7, 1)
    assert (world.grid.voxel_size_m, world.grid.origin_m, world.yaw_rad) == (0.1, (-1.0, 2.0, 0.0), 0.5)
    assert np.argwhere(world.occupied).tolist() == [[0, 0, 0], [2, 1, 0], [10, 6, 0]]
    assert world.name == "map"


@pytest.mark.parametrize("suffix", [".yaml", ".YML"])
def test_png_and_pgm_give_the_same_world(tmp_path, suffix):
    first = load_world(write(tmp_path, image=pgm(plan())))
    (tmp_path / "plan.PNG").write_bytes(png(plan()))
    path = tmp_path / f"other{suffix}"
    path.write_bytes(YAML.replace(b"plan.pgm", b"plan.PNG"))
    np.testing.assert_array_equal(load_world(path).occupied, first.occupied)


def test_colours_and_opacity_are_averaged_in_trinary_mode(tmp_path):
    """Black is 63.75 with its opacity, p = 0.75; shade 150 is 176.25, p = 0.31, and 0.41 without."""
    pixels = np.zeros((2, 3, 4), np.uint8)
    pixels[:, :, 3] = 255
    pixels[0, 1:, :3] = 255
    pixels[1, :, :3] = 150
    yaml = YAML.replace(b"plan.pgm", b"plan.png").replace(b"free_thresh: 0.196", b"free_thresh: 0.35")
    trinary = load_world(write(tmp_path, yaml, png(pixels), "plan.png"))
    assert trinary.occupied[:, :, 0].tolist() == [[False, True], [False, False], [False, False]]
    raw = load_world(write(tmp_path, yaml.replace(b"trinary", b"raw"), png(pixels[:, :, :3]), "plan.png"))
    assert raw.occupied[:, :, 0].tolist() == [[True, False], [True, True], [True, True]]


def test_an_image_in_a_folder_below_is_read(tmp_path):
    path = write(tmp_path, YAML.replace(b"plan.pgm", b"sub/plan.pgm"), pgm(plan()), "sub/plan.pgm")
    assert load_world(path).grid.shape == (11, 7, 1)


@needs_posix
def test_a_map_may_be_linked_to(tmp_path):
    """Yaml and image are links to one folder."""
    (tmp_path / "there").mkdir()
    (tmp_path / "here").mkdir()
    path = write(tmp_path / "there", YAML, pgm(plan()))
    for file in (path, path.with_name("plan.pgm")):
        (tmp_path / "here" / file.name).symlink_to(file)
    assert load_world(tmp_path / "here" / path.name).grid.shape == (11, 7, 1)


@needs_posix
@pytest.mark.parametrize(
    "image",
    [
        "../plan.pgm",
        "sub/../../plan.pgm",
        "{folder}/plan.pgm",
        "link.pgm",
        "linked/plan.pgm",
        "C:\\plan.pgm",
        "/dev/zero",
    ],
)
def test_images_outside_the_folder_are_refused(tmp_path, image):
    inside = tmp_path / "maps"
    (inside / "sub").mkdir(parents=True)
    (tmp_path / "plan.pgm").write_bytes(pgm(plan()))
    (inside / "link.pgm").symlink_to(tmp_path / "plan.pgm")
    (inside / "linked").symlink_to(tmp_path)
    image = image.format(folder=tmp_path)
    with pytest.raises(WorldError, match=r"in the YAML's folder"):
        load_world(write(inside, YAML.replace(b"plan.pgm", image.encode())))


@pytest.mark.parametrize(
    ("old", "new", "allowed"),
    [
        (b"resolution: 0.1\n", b"", "the entry resolution"),
        (b"resolution: 0.1", b"resolution: 0", "resolution"),
        (b"resolution: 0.1", b"resolution: .nan", "resolution"),
        (b"resolution: 0.1", b"resolution: '0.1'", "resolution"),
        (b"free_thresh: 0.196", b"free_thresh: 0.8", "free_thresh is at most"),
        (b"negate: 0", b"negate: 2", "negate"),
        (b"mode: trinary", b"mode: quaternary", "trinary, scale, raw"),
        (b"[-1.0, 2.0, 0.5]", b"[-1.0, 2.0]", "three numbers"),
        (b"[-1.0, 2.0, 0.5]", b"[-1.0, .inf, 0.5]", "three finite numbers"),
        (b"image: plan.pgm", b"image: &x plan.pgm\nsame: *x", "aliases"),
        (b"image: plan.pgm", b"image: !!python/object/apply:os.getcwd []", "aliases and tags"),
        (b"image: plan.pgm", b"image: nowhere.pgm", "exists"),
        (b"image: plan.pgm", b"image: map.yaml", r"\.png or \.pgm"),
    ],
)
def test_what_a_yaml_may_say(tmp_path, old, new, allowed):
    with pytest.raises(WorldError, match=allowed) as raised:
        load_world(write(tmp_path, YAML.replace(old, new), pgm(plan())))
    assert raised.value.field == "world file"
