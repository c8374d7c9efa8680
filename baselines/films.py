"""A small film of every named scenario: `python -m baselines.films` writes docs/films/NAME.gif.

A mission each of the recommended strategy (but see QUICKER), with the scenario's own team, for README and the
cards of scenarios. The same version gives the same films.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np
from PIL import Image

from baselines.cli.arguments import make_folder, parse, run_command
from baselines.experiments.mission import run_mission, scripted_env
from baselines.strategies import make_strategy, recommended
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import SettingError
from entropy_explore_env.reports.animation import Film, animate
from entropy_explore_env.reports.painting import Painter
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.scenarios import SCENARIOS
from entropy_explore_env.validation import check_whole

QUICKER = MappingProxyType({"bhattacharya-cluttered": "nearest-frontier"})
"""Scenario → what is filmed in place of what we recommend, which computes for over ten minutes there."""
_FRAME_S, _LAST = 0.15, 12
"""How long each picture is shown, and how often the last one."""


@dataclass
class Args:
    """Make a film of each named scenario."""

    scenarios: str = "all"
    """Named scenarios, commas between."""
    strategy: str | None = None
    """Chooses viewpoints, as in baselines.run; default: the one that is recommended in each scenario, or
    nearest-frontier where that one computes for too long."""
    seed: int = 0
    """Of every mission."""
    pictures: int = 28
    """Most pictures in a film."""
    width: int = 320
    """Of the films, in pixels; their height is three quarters of it."""
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
    strategies = [args.strategy or QUICKER.get(name, recommended(name)) for name in names]
    for strategy in strategies:
        make_strategy(strategy)
    make_folder("out", args.out)
    for number, (name, strategy) in enumerate(zip(names, strategies, strict=True), 1):
        print(f"{number} of {len(names)}: {name}", file=sys.stderr, flush=True)
        film = filmed(SCENARIOS[name], strategy, args.seed, args.pictures)
        path = args.out / f"{name}.gif"
        animate((shrunk(picture, args.width) for picture in film.pictures(_LAST)), path, _FRAME_S)
        print(f"{path}, {path.stat().st_size / 1000:,.0f} kB")
    return 0


def filmed(scenario: Scenario, strategy: str, seed: int, pictures: int) -> Film:
    """The film of a mission.

    Args:
        scenario: The task.
        strategy: Name of the strategy.
        seed: Of the mission.
        pictures: At most so many, spread evenly.
    """
    painter, film = Painter("rgb_array"), Film(pictures)

    def note(env: EntropyExploreEnv) -> None:
        painter.watch(env.missions)
        time_s = float(env.missions.state.missions[0]["time_s"])
        if film.due(time_s) or not env.agents:
            picture = painter.picture(env.missions)
            assert picture is not None  # in this mode there is one
            film.add(time_s, picture)

    run_mission(scripted_env(scenario), make_strategy(strategy), seed, note)
    return film


def shrunk(picture: np.ndarray, width: int) -> np.ndarray:
    """A picture (H, W, 3) uint8 in another width, its height in proportion."""
    height = round(picture.shape[0] * width / picture.shape[1])
    return np.asarray(Image.fromarray(picture).resize((width, height), Image.Resampling.BOX))


if __name__ == "__main__":
    raise SystemExit(run_command(main))
