"""List, draw and convert worlds: `python -m entropy_explore_env worlds list | show | convert`.

    list [FOLDER]                      scenarios and names, or the files of a folder that can be read
    show NAME_OR_FILE --out world.png  sizes and where robots may start, and a picture with metres
    convert IN OUT.npz                 a file that loads fast, without loss

Results go to standard output, errors in one line to standard error. Exit codes: 0 done, 2 bad input, 130
interrupted.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

import numpy as np

from entropy_explore_env.command import LineParser
from entropy_explore_env.errors import SettingError, did_you_mean
from entropy_explore_env.randomness import Stream, check_seed, generator
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import SCENARIOS
from entropy_explore_env.settings.validation import is_whole
from entropy_explore_env.worlds.files.jacksboro import NAME as JACKSBORO
from entropy_explore_env.worlds.formats import FORMATS, NAMES, WORDS
from entropy_explore_env.worlds.given import in_given_worlds
from entropy_explore_env.worlds.load import load_world, make_world, save_world
from entropy_explore_env.worlds.pictures import picture
from entropy_explore_env.worlds.public.table import PUBLIC
from entropy_explore_env.worlds.recipes.catalogue import about_recipe
from entropy_explore_env.worlds.world import World
from entropy_explore_env.writing import write_atomically

_NUMBERS = {
    "voxel-size-m": "edge of the voxels; default: the file's own",
    "height-m": "extrude a plan to this height",
    "resolution-m": "edge of an image's pixel, or spacing of a height map that does not state it",
    "occupied-below": "plans: pixels darker than this shade, 0 to 255, are solid",
    "free-above": "plans: pixels lighter than this shade are free, those between unknown",
    "elevation-step-m": "height of one count of a 16-bit image",
    "clearance-m": "free space above a height map, or around a mesh",
    "ceiling-m": "height of the exposure surface above the ground of a height map",
    "gap-m": "point clouds: gaps between points up to this width are solid",
    "scale": "meshes and point clouds: metres of a unit, 0.001 for millimetres",
    "read-limit-s": "limit of the processor time for reading",
    "read-memory-mib": "limit of the memory for reading; default: by the file's size",
}
"""Options of `load_world` that are numbers."""
_WORDS = {
    "up": (WORDS["up"], "meshes and point clouds: the axis that points up"),
    "map-rule": (
        WORDS["map_rule"],
        "YAML: how it is read, as by nav2 (default) or as before 2025",
    ),
}
"""Options of `load_world` that are words: those that they may be, and what they say."""
_OF_SCENARIOS = ("seed", "split", "world_number")


def main(words: Sequence[str]) -> int:
    """Run the command; the exit code."""
    args = _parser().parse_args(words)
    if args.command == "list":
        _list(args.folder)
        return 0
    target: Path | None = args.out
    if target is not None:
        _check_target(target, ".png" if args.command == "show" else ".npz")
    world = _world(args)
    about = _about(world)
    if args.command == "show":
        starts, said = _starts(world, args.source)
        print(f"{args.source}: {about}; {said}")
        if target is not None:
            write_atomically(target, picture(world, starts))
            print(target)
    else:
        save_world(world, args.out)
        print(f"{target}: {about}")
    if args.source in PUBLIC:
        source = PUBLIC[args.source].source
        print(f"licence: {source.licence}\ncite: {source.citation}")
    return 0


def _check_target(target: Path, suffix: str) -> None:
    """Raise a SettingError unless a file with a suffix can have this path."""
    if target.suffix.lower() != suffix or target.is_dir():
        raise SettingError("out", str(target), f"a file whose name ends in {suffix}")
    if any(folder.is_file() for folder in target.parents):
        raise SettingError("out", str(target), "a file in a folder")


def _parser() -> argparse.ArgumentParser:
    kind = argparse.RawDescriptionHelpFormatter
    parser = LineParser(
        prog="python -m entropy_explore_env worlds", description=__doc__, formatter_class=kind
    )
    commands = parser.add_subparsers(dest="command", required=True)
    listing = commands.add_parser("list", help="recipes, names and files")
    listing.add_argument("folder", nargs="?", type=Path, help="list the files in it, and in folders in it")
    show = commands.add_parser("show", help="draw a world")
    show.add_argument("source", metavar="NAME_OR_FILE")
    show.add_argument("--out", type=Path, help="a PNG; default: no picture")
    convert = commands.add_parser("convert", help="save a world as .npz")
    convert.add_argument("source", metavar="IN")
    convert.add_argument("out", type=Path, metavar="OUT.npz")
    for command in (show, convert):
        for name, text in _NUMBERS.items():
            command.add_argument(f"--{name}", type=float, help=text)
        command.add_argument(
            "--negate", action="store_true", default=None, help="images: bright pixels are solid"
        )
        for name, (known, text) in _WORDS.items():
            command.add_argument(f"--{name}", choices=known, help=text)
        command.add_argument(
            "--hollow", action="store_true", help="meshes: do not fill the space that they enclose"
        )
        inside = "meshes: a building drawn by its inner walls, free inside"
        command.add_argument("--inside", action="store_true", default=None, help=inside)
        command.add_argument("--seed", type=int, help="scenarios: of the mission in this world; default: 0")
        command.add_argument(
            "--world-number", type=int, help="scenarios: as of make_world, instead of --seed and --split"
        )
        command.add_argument("--split", help="scenarios: train, validation or test; default: train")
    return parser


def _list(folder: Path | None) -> None:
    """Print what can be shown, a line each."""
    if folder is None:
        for name, scenario in SCENARIOS.items():
            print(f"{name}\tscenario\t{about_recipe(scenario.world)}")
        print(f"{JACKSBORO}\televation model\tcomes with matplotlib")
        for about, named in groupby(PUBLIC, lambda name: PUBLIC[name].about):
            first, *others = named
            names = f"{first} … {others[-1]}" if others else first
            print(f"{names}\tpublic world\t{about}; {PUBLIC[first].source.licence}")
        for suffix, form in FORMATS.items():
            print(f"*{suffix}\tfile\t{form.kind}")
        return
    if not folder.is_dir():
        raise SettingError("folder", str(folder), "a folder that exists")
    for path in sorted(folder.rglob("*")):
        form = FORMATS.get(path.suffix.lower())
        if form is not None and path.is_file():
            print(f"{path}\tfile\t{form.kind}")


def _world(args: argparse.Namespace) -> World:
    """Return the world that a name or a file stands for."""
    given = {name.replace("-", "_"): getattr(args, name.replace("-", "_")) for name in (*_NUMBERS, *_WORDS)}
    if args.hollow:
        given["fill"] = False
    given |= {"negate": args.negate, "inside": args.inside}
    if args.source not in SCENARIOS:
        _refuse(args, _OF_SCENARIOS, "no value for a file")
        if not Path(args.source).suffix and args.source not in NAMES:
            allowed = "a world file, or a name that `worlds list` shows"
            allowed += did_you_mean(args.source, (*SCENARIOS, *NAMES))
            raise SettingError("source", args.source, allowed)
        return load_world(args.source, **given)
    for name, value in given.items():
        if value is not None:
            raise SettingError(name, value, "no value for a scenario")
    return _world_of_scenario(SCENARIOS[args.source], args)


def _world_of_scenario(scenario: Scenario, args: argparse.Namespace) -> World:
    """Return the world with a number, or that of a mission with a seed."""
    if args.world_number is None:
        scenario = with_settings(scenario, {"split": args.split or "train"})
        return make_world(scenario, generator(check_seed(args.seed or 0), 0, Stream.WORLD))
    _refuse(args, ("seed", "split"), "no value beside --world-number, which names the world")
    if not is_whole(args.world_number, 0):
        raise SettingError("world_number", args.world_number, "a whole number ≥ 0")
    return make_world(scenario, args.world_number)


def _refuse(args: argparse.Namespace, names: Sequence[str], allowed: str) -> None:
    """Raise a SettingError for the first of some options that is given."""
    for name in names:
        value = getattr(args, name)
        if value is not None:
            raise SettingError(name, value, allowed)


def _about(world: World) -> str:
    x, y, z = world.grid.shape
    free = 1.0 - float(world.occupied.mean())
    metres = " × ".join(f"{edge:.6g}" for edge in world.grid.size_m[: 2 if world.grid.flat else 3])
    return f"{x} × {y} × {z} voxels of {world.grid.voxel_size_m:.6g} m, {metres} m, {free:.1%} free"


def _starts(world: World, source: str) -> tuple[np.ndarray | None, str]:
    """Return where robots may start, (X, Y, Z) bool, and a sentence about it; None where there is no room."""
    name = source if source in SCENARIOS else "office" if world.grid.flat else "room"
    try:
        layout = world.layout(in_given_worlds(SCENARIOS[name], [world]))
    except SettingError as error:
        return None, f"robots of {name} have no room: {error.field}, expected {error.allowed}"
    starts = np.zeros(world.grid.shape, bool)
    starts.reshape(-1)[layout.starts] = True
    share = float(starts.sum() / (~world.occupied).sum())
    return starts, f"robots of {name} may start in {share:.1%} of the free voxels"
