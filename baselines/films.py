"""A small film of every named scenario: `python -m baselines.films` writes docs/films/NAME.webp.

A mission each of the recommended strategy, with the scenario's own team, for README and the
cards of scenarios. With `--beside STRATEGY` a film shows two missions, in the same world and from the same
start: `NAME-FIRST-SECOND.webp`. The same version gives the same films.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from PIL import Image, ImageDraw

from baselines.cli.arguments import make_folder, parse, run_command
from baselines.cli.mission_outputs import film_moment
from baselines.experiments.mission import run_mission, scripted_env
from baselines.strategies import make_strategy, recommended, shown_name
from entropy_explore_env.errors import SettingError
from entropy_explore_env.picture_text import shortened
from entropy_explore_env.reports.animation import Film, animate
from entropy_explore_env.reports.annotations import write
from entropy_explore_env.reports.colours import PAPER
from entropy_explore_env.reports.painting import Painter
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import SCENARIOS
from entropy_explore_env.settings.validation import check_whole

_FRAME_S, _LAST = 0.15, 12
"""How long each picture is shown, and how often the last one."""


@dataclass
class Args:
    """Make a film of each named scenario."""

    scenarios: str = "all"
    """Named scenarios, commas between."""
    strategy: str | None = None
    """Chooses viewpoints, as in baselines.run; default: the one that is recommended in each scenario."""
    beside: str | None = None
    """A second strategy, shown to the right of the first one on the same clock."""
    split: Literal["train", "test"] | None = None
    """Which worlds are drawn; default: as the scenario says."""
    seed: int = 0
    """Of every mission."""
    pictures: int = 28
    """Most pictures in a film."""
    width: int = 320
    """Of a mission's picture, in pixels; its height is three quarters of it."""
    out: Path = Path("docs/films")
    """Folder for the films."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    check_whole("seed", args.seed, 0)
    check_whole("pictures", args.pictures, 2)
    check_whole("width", args.width, 80)
    names = list(SCENARIOS) if args.scenarios == "all" else args.scenarios.split(",")
    for name in names:
        if name not in SCENARIOS:
            raise SettingError("scenarios", name, "all, or names out of " + ", ".join(SCENARIOS))
    first = [args.strategy or recommended(name) for name in names]
    for strategy in {*first, *([args.beside] if args.beside else [])}:
        make_strategy(strategy)
    make_folder("out", args.out)
    for number, (name, strategy) in enumerate(zip(names, first, strict=True), 1):
        print(f"{number} of {len(names)}: {name}", file=sys.stderr, flush=True)
        scenario = SCENARIOS[name]
        if args.split is not None:
            scenario = with_settings(scenario, {"split": args.split})
        shown = [each for each in (strategy, args.beside) if each is not None]
        films = [filmed(scenario, each, args.seed, args.pictures) for each in shown]
        pictures = (shrunk(picture, args.width) for picture in films[0].pictures(_LAST))
        titles = [shown_name(each) for each in shown]
        if len(films) > 1:
            pictures = beside_each_other(films, titles, args.width)
        title = "-".join([name, *titles] if len(films) > 1 else [name]).replace(":", "-")
        path = args.out / f"{title}.webp"
        animate(pictures, path, _FRAME_S)
        print(f"{path}, {path.stat().st_size / 1000:,.0f} kB")
    return 0


def beside_each_other(films: Sequence[Film], names: Sequence[str], width: int) -> Iterator[np.ndarray]:
    """Yield pictures (H, W, 3) uint8 of several missions on one clock, each under its name.

    Each mission's picture is `width` pixels wide; the film of a mission that is over stands still.
    """
    longest = max(films, key=lambda film: film.times_s[-1])
    for time_s in [*longest.times_s, *[longest.times_s[-1]] * (_LAST - 1)]:
        parts = []
        for film, name in zip(films, names, strict=True):
            end_s = film.times_s[-1]
            over = f", over after {end_s:.0f} s" if time_s >= end_s else ""
            parts.append(_titled(shrunk(film.picture_at(time_s), width), f"{name}{over}"))
        yield np.concatenate(parts, axis=1)


def _titled(picture: np.ndarray, title: str) -> np.ndarray:
    """Return a picture with a line of text above it."""
    height, width, _ = picture.shape
    size = max(width // 24, 8)
    page = Image.new("RGB", (width, height + 2 * size), PAPER)
    page.paste(Image.fromarray(picture), (0, 2 * size))
    write(ImageDraw.Draw(page), (size // 2, size), shortened(title, width - size, size), size, "lm")
    return np.asarray(page)


def filmed(scenario: Scenario, strategy: str, seed: int, pictures: int) -> Film:
    """Return the film of a mission, of at most this many pictures, spread evenly."""
    painter, film = Painter("rgb_array"), Film(pictures)
    env, made = scripted_env(scenario), make_strategy(strategy)
    run_mission(env, made, seed, lambda env: film_moment(env, painter, [film]))
    return film


def shrunk(picture: np.ndarray, width: int) -> np.ndarray:
    """Return a picture (H, W, 3) uint8 in another width, its height in proportion."""
    height = round(picture.shape[0] * width / picture.shape[1])
    return np.asarray(Image.fromarray(picture).resize((width, height), Image.Resampling.BOX))


if __name__ == "__main__":
    raise SystemExit(run_command(main))
