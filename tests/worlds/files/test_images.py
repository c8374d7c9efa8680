"""Plans drawn as images."""

from __future__ import annotations

import io
import struct
import zlib

import numpy as np
import pytest
from PIL import Image

from benchmarks.proofs.world_samples import image, pgm
from entropy_explore_env.errors import SettingError, WorldError, WorldWarning
from entropy_explore_env.worlds.load import load_world


def load(tmp_path, data, name="plan.png", **options):
    (tmp_path / name).write_bytes(data)
    return load_world(tmp_path / name, **options)


def test_dark_is_solid_and_the_last_row_is_the_lowest(tmp_path):
    shades = np.full((5, 7), 230, np.uint8)
    shades[4, 1], shades[0, 6], shades[2, 3], shades[2, 4] = 0, 60, 127, 128  # half of white is 127.5
    for name, data in (("plan.png", image(shades)), ("plan.PGM", pgm(shades))):
        world = load(tmp_path, data, name)
        assert world.grid.shape == (7, 5, 1)
        assert (world.grid.voxel_size_m, world.grid.origin_m) == (0.05, (0.0, 0.0, 0.0))
        assert np.argwhere(world.occupied).tolist() == [[1, 0, 0], [3, 2, 0], [6, 4, 0]]
        opposite = load(tmp_path, data, name, negate=True, resolution_m=0.2)
        np.testing.assert_array_equal(opposite.occupied, ~world.occupied)
        assert opposite.grid.voxel_size_m == 0.2


@pytest.mark.filterwarnings("ignore::entropy_explore_env.errors.WorldWarning")
def test_colours_are_averaged_and_transparent_pixels_are_unknown(tmp_path):
    pixels = np.full((2, 3, 4), 255, np.uint8)
    pixels[0, 0, :3] = (255, 128, 0)  # 127.7
    pixels[0, 1, :3] = (255, 126, 0)  # 127
    pixels[1, 2, 3] = 254
    world = load(tmp_path, image(pixels))
    assert np.argwhere(world.occupied).tolist() == [[1, 1, 0], [2, 0, 0]]
    assert np.argwhere(world.unknown).tolist() == [[2, 0, 0]]


def test_grey_walls_are_told_and_a_limit_makes_them_solid(tmp_path):
    shades = np.full((5, 8), 255, np.uint8)
    shades[:, 3] = 150
    with pytest.warns(WorldWarning, match="grey pixels, of shades from 90 to 204, 5 count as free"):
        assert not load(tmp_path, image(shades)).occupied.any()
    world = load(tmp_path, image(shades), occupied_below=200)
    assert np.unique(np.nonzero(world.occupied)[0]).tolist() == [3]
    some = load(tmp_path, image(shades), free_above=200)
    assert some.unknown is not None and (some.unknown == world.occupied).all()


@pytest.mark.parametrize("kind", ["PNG", "PPM", "JPEG", "BMP", "GIF"])
def test_the_content_decides_what_kind_of_image_it_is(tmp_path, kind):
    shades = np.full((16, 24), 255, np.uint8)
    shades[:, 8:16] = 0
    buffer = io.BytesIO()
    Image.fromarray(shades).save(buffer, kind)
    for suffix in (".png", ".pgm", ".jpg", ".JPEG", ".bmp", ".gif"):
        world = load(tmp_path, buffer.getvalue(), f"plan{suffix}")
        np.testing.assert_array_equal(world.occupied[:, :, 0], shades[::-1].T == 0)


@pytest.mark.parametrize("mode", ["1", "P", "CMYK", "RGBA", "LA", "I;16"])
def test_every_mode_of_pixels_is_read(tmp_path, mode):
    picture = Image.new("L", (9, 4), 255)
    picture.paste(0, (2, 0, 4, 4))
    if mode == "I;16":  # a PGM, as a 16-bit PNG is a height map
        shades = np.asarray(picture).astype(">u2") * 257
        data, name = b"P5\n9 4\n65535\n" + shades.tobytes(), "plan.pgm"
    else:
        buffer, name = io.BytesIO(), "plan.jpg"
        picture.convert(mode).save(buffer, "JPEG" if mode == "CMYK" else "PNG")
        data = buffer.getvalue()
    world = load(tmp_path, data, name)
    assert np.unique(np.nonzero(world.occupied)[0]).tolist() == [2, 3]


def test_a_plan_is_resampled_and_extruded(tmp_path):
    shades = np.full((6, 8), 255, np.uint8)
    shades[:, 3] = 0  # a wall one pixel thick
    world = load(tmp_path, image(shades), voxel_size_m=0.1, height_m=0.3, resolution_m=0.05)
    assert world.grid.shape == (4, 3, 3)
    assert world.occupied[1].all()
    assert not world.occupied[[0, 2, 3]].any()
    with pytest.raises(SettingError, match=r"height_m = 0\.1: expected from 2 to"):
        load(tmp_path, image(shades), voxel_size_m=0.1, height_m=0.1)


def test_a_16_bit_png_is_a_height_map(tmp_path):
    """Counts of 0.5 m: 0, 2 and 5 m; from -1 m on, layers of 1 m below the surface: 1, 3 and 6."""
    counts = np.array([[0, 4, 10], [0, 4, 10]], np.uint16)
    world = load(tmp_path, image(counts), resolution_m=1.0, elevation_step_m=0.5, clearance_m=2.0)
    assert world.grid.shape == (3, 2, 8)
    assert world.grid.origin_m == (0.0, 0.0, -1.0)
    assert world.occupied.sum(axis=2).tolist() == [[1, 1], [3, 3], [6, 6]]
    with pytest.raises(SettingError, match="resolution_m = None"):
        load(tmp_path, image(counts))
    with pytest.raises(SettingError, match="negate = True: expected None"):
        load(tmp_path, image(counts), resolution_m=1.0, negate=True)


def bomb(edge):
    """A PNG of so many black pixels squared, a thousandth of that in the file."""
    header = struct.pack(">IIBBBBB", edge, edge, 8, 0, 0, 0, 0)
    chunks = [
        (b"IHDR", header),
        (b"IDAT", zlib.compress(bytes((edge + 1) * min(edge, 6000)), 9)),
        (b"IEND", b""),
    ]
    body = [struct.pack(">I", len(c)) + k + c + struct.pack(">I", zlib.crc32(k + c)) for k, c in chunks]
    return b"\x89PNG\r\n\x1a\n" + b"".join(body)


def test_absurd_sizes_are_refused_by_the_header(tmp_path):
    for data in (bomb(24000), b"P5\n24000 24000\n255\n"):
        with pytest.raises(WorldError, match="at most 536870912 pixels"):
            load(tmp_path, data)


def test_what_is_no_image_is_refused(tmp_path):
    with pytest.raises(WorldError, match="a PNG, PGM, JPEG, BMP or GIF, whatever its suffix"):
        load(tmp_path, b"once upon a time", "plan.png")
