"""Floor plans of map_server: the three modes by hand, frames, and files that lead astray."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.proofs.world_samples import YAML, image, pgm, plan
from entropy_explore_env.errors import SettingError, WorldError, WorldWarning
from entropy_explore_env.worlds.files.map_server import labelling
from entropy_explore_env.worlds.load import load_world
from tests.systems import needs_posix


def labels(shades, mode, negate=False, free=0.196, occupied=0.65, **more):
    return labelling(mode, negate, free, occupied, **more)(np.array(shades, np.float64)).tolist()


LIMITS = {"free": 0.4, "occupied": 0.6}
SHADES = {"given": (150.0, 205.0)}


@pytest.mark.parametrize(
    ("shades", "expected", "mode", "more"),
    [
        # p = (255 - x)/255: 89 → 0.651, 90 → 0.647, 205 → 0.1961, 206 → 0.192.
        ([0, 89, 90, 205, 206, 255], "##??..", "trinary", {}),
        # p = x/255: 49 → 0.192, 50 → 0.1961, 165 → 0.647, 166 → 0.651.
        ([0, 49, 50, 165, 166, 255], "..??##", "trinary", {"negate": True}),
        # p = 0.4 at 153 and 0.6 at 102: thresholds themselves count, unless the old rule is asked for.
        ([255, 153, 102, 0], "..##", "trinary", LIMITS),
        ([255, 153, 102, 0], ".??#", "trinary", {**LIMITS, "strict": True}),
        ([154, 152, 103, 101], ".??#", "trinary", LIMITS),
        ([154, 152, 103, 101], ".??#", "trinary", {**LIMITS, "strict": True}),
        ([0, 255], "#.", "trinary", {"free": 0.0, "occupied": 1.0}),
        # Shades that are given stand in for thresholds.
        ([0, 149, 150, 205, 206], "##??.", "trinary", SHADES),
        ([255, 106, 105, 50, 49], "##??.", "trinary", {**SHADES, "negate": True}),
        # Thresholds 0.2 and 0.6: 1 + 98 (p - 0.2)/0.4 is 49.0 for x = 154 and 51.0 for x = 152.
        ([255, 210, 154, 152, 110, 0], "...###", "scale", {"free": 0.2, "occupied": 0.6}),
        ([205], "?", "scale", {}),
        ([205], ".", "scale", {"strict": True}),
        ([0, 49, 50, 100, 101, 255], "..##??", "raw", {}),
        ([0, 49, 50, 100, 101, 255], "..##??", "raw", {"negate": True}),
    ],
)
def test_shades_are_labelled_by_hand(shades, expected, mode, more):
    """Free, solid and unknown are . # and ?"""
    assert "".join("?.#"[label + 1] for label in labels(shades, mode, **more)) == expected


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


IGNORED = pytest.mark.filterwarnings("ignore::entropy_explore_env.errors.WorldWarning")


@IGNORED
def test_opacity_is_averaged_in_trinary_mode_by_the_old_rule_only(tmp_path):
    """Black is 63.75 with its opacity, p = 0.75; shade 150 is 176.25, p = 0.31, and 0.41 without."""
    pixels = np.zeros((2, 3, 4), np.uint8)
    pixels[:, :, 3] = 255
    pixels[0, 1:, :3] = 255
    pixels[1, :, :3] = 150
    yaml = YAML.replace(b"plan.pgm", b"plan.png").replace(b"free_thresh: 0.196", b"free_thresh: 0.35")
    path = write(tmp_path, yaml, image(pixels), "plan.png")
    trinary = load_world(path, map_rule="map_server")
    assert trinary.occupied[:, :, 0].tolist() == [[False, True], [False, False], [False, False]]
    with pytest.warns(WorldWarning, match="grey pixels, of shades from 90 to 204, 3 count as unknown"):
        now = load_world(path)
    assert now.occupied[:, :, 0].tolist() == [[True, True], [True, False], [True, False]]
    assert now.unknown is not None and now.unknown.sum() == 3
    raw = load_world(write(tmp_path, yaml.replace(b"trinary", b"raw"), image(pixels[:, :, :3]), "plan.png"))
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
    "entry",
    ["/home/me/plan.pgm", "~/plan.pgm", "../maps/plan.pgm", "C:\\maps\\plan.pgm", "PLAN.pgm", "sub/Plan.PGM"],
)
def test_an_image_that_lies_beside_the_yaml_is_read_wherever_the_entry_leads(tmp_path, entry):
    path = write(tmp_path, YAML.replace(b"plan.pgm", entry.encode()), pgm(plan()))
    with pytest.warns(WorldWarning, match=r"is read from plan\.pgm beside the YAML"):
        assert load_world(path).grid.shape == (11, 7, 1)


def test_an_absolute_path_into_the_folder_is_no_other_file(tmp_path):
    path = write(tmp_path, YAML.replace(b"plan.pgm", str(tmp_path / "plan.pgm").encode()), pgm(plan()))
    assert load_world(path).grid.shape == (11, 7, 1)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"resolution: 0.1", b"resolution: 1e-1"),
        (b"resolution: 0.1", b"resolution: '0.1'"),
        (b"[-1.0, 2.0, 0.5]", b"[-1, '2.0', 5e-1]"),
        (b"mode: trinary", b"mode: Trinary"),
        (b"negate: 0", b"negate: 0.0"),
        (b"negate: 0", b"negate: 'False'"),
        (b"negate: 0", b"negate: off"),
        (b"negate: 0", b""),
        (b"mode: trinary", b""),
    ],
)
def test_numbers_modes_and_truth_values_are_those_of_map_server(tmp_path, old, new):
    first = load_world(write(tmp_path, YAML, pgm(plan())))
    again = load_world(write(tmp_path, YAML.replace(old, new), pgm(plan())))
    assert again.grid == first.grid and again.yaw_rad == first.yaw_rad
    np.testing.assert_array_equal(again.occupied, first.occupied)


def test_negate_in_words(tmp_path):
    first = load_world(write(tmp_path, YAML.replace(b"negate: 0", b"negate: 1"), pgm(plan())))
    again = load_world(write(tmp_path, YAML.replace(b"negate: 0", b"negate: TRUE"), pgm(plan())))
    np.testing.assert_array_equal(again.occupied, first.occupied)


def house(unknown=205):
    """A floor of 6 x 3 pixels in walls, in 10 x 20 pixels of unknown."""
    shades = np.full((20, 10), unknown, np.uint8)
    shades[4:9, 1:9] = 0
    shades[5:8, 2:8] = 254
    return shades


def test_unknown_that_counts_as_free_is_told(tmp_path):
    path = write(tmp_path, YAML.replace(b"free_thresh: 0.196", b"free_thresh: 0.25"), pgm(house()))
    with pytest.warns(WorldWarning, match="160 pixels of shade 205, .* count as free"):
        world = load_world(path)
    assert (~world.occupied).sum() == 18 + 160
    known = load_world(path, free_above=205)
    assert known.unknown is not None
    assert ((~known.occupied).sum(), known.unknown.sum()) == (18, 160)


def test_opaque_alpha_changes_nothing_and_any_transparency_is_unknown(tmp_path):
    yaml = YAML.replace(b"plan.pgm", b"plan.png")
    first = load_world(write(tmp_path, YAML, pgm(house())))
    pixels = np.stack((house(), np.full_like(house(), 255)), axis=2)
    again = load_world(write(tmp_path, yaml, image(pixels), "plan.png"))
    np.testing.assert_array_equal(again.occupied, first.occupied)
    np.testing.assert_array_equal(again.unknown, first.unknown)
    pixels[5:8, 2:8, 1] = 254
    with pytest.raises(WorldError, match="18 pixels that are not wholly opaque count as unknown"):
        load_world(write(tmp_path, yaml, image(pixels), "plan.png"))


def test_large_margins_are_cropped_and_places_stay(tmp_path):
    """The house in 1100 x 1000 pixels: its corner is column 501 and row 11 from below."""
    shades = np.full((1000, 1100), 205, np.uint8)
    shades[980:1000, 500:510] = house()
    yaml = YAML.replace(b"0.5]", b"1.5707963267948966]")
    with pytest.warns(WorldWarning, match="cropped from 1100 × 1000 to 8 × 5, as no robot can get beyond"):
        world = load_world(write(tmp_path, yaml, pgm(shades)))
    assert world.grid.shape == (8, 5, 1)
    assert (~world.occupied).sum() == 18
    assert world.grid.origin_m == pytest.approx((-1.0 - 1.1, 2.0 + 50.1, 0.0))


def test_limits_of_shades_are_checked(tmp_path):
    path = write(tmp_path, image=pgm(house()))
    for setting in ({"occupied_below": 256}, {"free_above": -1}, {"map_rule": "ros"}):
        with pytest.raises(SettingError, match=f"{next(iter(setting))} = "):
            load_world(path, **setting)
    with pytest.raises(SettingError, match="free_above = 100"):
        load_world(path, free_above=100, occupied_below=150)


@pytest.mark.parametrize(
    ("old", "new", "allowed"),
    [
        (b"resolution: 0.1\n", b"", "the entry resolution"),
        (b"resolution: 0.1", b"resolution: 0", "resolution"),
        (b"resolution: 0.1", b"resolution: .nan", "resolution"),
        (b"resolution: 0.1", b"resolution: 0_1", "resolution"),
        (b"free_thresh: 0.196", b"free_thresh: 0.8", "free_thresh is at most"),
        (b"negate: 0", b"negate: 2", "negate"),
        (b"mode: trinary", b"mode: quaternary", "trinary, scale, raw"),
        (b"[-1.0, 2.0, 0.5]", b"[-1.0, 2.0]", "three finite numbers"),
        (b"[-1.0, 2.0, 0.5]", b"[-1.0, .inf, 0.5]", "three finite numbers"),
        (b"image: plan.pgm", b"image: &x plan.pgm\nsame: *x", "aliases"),
        (b"image: plan.pgm", b"image: !!python/object/apply:os.getcwd []", "aliases and tags"),
        (b"image: plan.pgm", b"image: nowhere.pgm", "exists"),
        (b"image: plan.pgm", b"image: map.yaml", "PNG, PGM, JPEG, BMP or GIF"),
        (b"image: plan.pgm", b"image:\tplan.pgm", r"in YAML, but .* '\\t' that .* line 1, column 7"),
        (b"image: plan.pgm", "image: Büro.pgm".encode("latin-1"), "in YAML, but .* position 8"),
    ],
)
def test_what_a_yaml_may_say(tmp_path, old, new, allowed):
    with pytest.raises(WorldError, match=allowed) as raised:
        load_world(write(tmp_path, YAML.replace(old, new), pgm(plan())))
    assert raised.value.field == "world file"
