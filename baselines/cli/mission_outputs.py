"""What a command keeps of a mission while it runs, and the files that it writes at its end."""

from __future__ import annotations

import importlib.util
import json
import time
from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from baselines.cli.arguments import make_folder, print_json
from baselines.cli.progress import named, print_table
from baselines.strategies import shown_name
from entropy_explore_env.belief.belief_map import Map
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import MissingExtraError, SettingError
from entropy_explore_env.interop.bag_writer import BagWriter
from entropy_explore_env.interop.map_files import save_map
from entropy_explore_env.interop.team_maps import joint_map
from entropy_explore_env.reports.animation import Film, animate, write_video
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.reports.mission_record import MOST_MAP_VOXELS, RESULTS, CommandRecorder, save_record
from entropy_explore_env.reports.painting import Painter
from entropy_explore_env.reports.recording import Recorder
from entropy_explore_env.reports.rerun_view import RerunView
from entropy_explore_env.settings.json import settings_of
from entropy_explore_env.writing import write_atomically

_GIF_PICTURES, _GIF_FRAME_S, _GIF_LAST = 100, 0.1, 20
_VIDEO_PICTURES, _VIDEO_FRAMES_PER_S, _VIDEO_LAST = 600, 25, 50
"""Most pictures, how long each is shown, and how often the last one."""
_SERIES_POINTS = 500


@dataclass
class Outputs:
    """Files to write, and the form of the results."""

    gif: Path | None = None
    """File for an animated GIF of the mission."""
    mp4: Path | None = None
    """File for a video of the mission (extra viewer)."""
    rerun: Path | None = None
    """File for a recording, an .rrd that Rerun's viewer opens (extra viewer)."""
    bag: Path | None = None
    """Folder for a ROS 2 bag of the mission, which must not exist (extra ros)."""
    truth: bool = False
    """Show the true world below the map in mission.png; needs --out."""
    json: bool = False
    """Print one JSON object and nothing else."""


def _prepare(outputs: Outputs, out: Path | None, record: Path | None) -> None:
    """Make the folders and find the packages of what is asked for; see `MissionLog`."""
    if outputs.truth and out is None:
        raise SettingError("truth", True, "--out beside it")
    mp4, rerun, bag = outputs.mp4, outputs.rerun, outputs.bag
    needed = (
        ("av", "av", mp4, "viewer"),
        ("rerun-sdk", "rerun", rerun, "viewer"),
        ("rosbags", "rosbags", bag, "ros"),
    )
    for package, module, file, extra in needed:
        if file is not None and importlib.util.find_spec(module) is None:
            raise MissingExtraError(package, extra)
    if bag is not None and bag.exists():
        raise SettingError("bag", str(bag), "a folder that does not exist yet")
    if out is not None:
        make_folder("out", out)
    if bag is not None:
        make_folder("bag", bag.parent)
    files = {"gif": outputs.gif, "mp4": mp4, "record": record, "rerun": rerun}
    for option, file in files.items():
        if file is not None:
            make_folder(option, file.parent)
            if file.is_dir():
                raise SettingError(option, str(file), "a file, not a folder")


def film_moment(env: EntropyExploreEnv, painter: Painter, films: Iterable[Film]) -> None:
    """Add a picture of the moment to the films in which one is due; the last moment is in all of them."""
    painter.watch(env.missions)
    time_s = float(env.missions.state.missions[0]["time_s"])
    due = [film for film in films if film.due(time_s) or not env.agents]
    picture = painter.picture(env.missions) if due else None
    for film in due:
        assert picture is not None  # "rgb_array" gives one
        film.add(time_s, picture)


class MissionLog:
    """Follows the mission of an environment; used as a context, so that nothing unfinished is left."""

    def __init__(
        self, outputs: Outputs, out: Path | None = None, record: Path | None = None, recorded: bool = True
    ) -> None:
        """Make the folders and find the packages, before anything is computed for nothing.

        Args:
            outputs: Files that each have an option.
            out: Folder for mission.json, mission.png, mission.gif and the team's map, and for mission.npz.
            record: A mission record, an `.npz`.
            recorded: Whether the folder gets a record, too; a replay has one already.

        Raises:
            SettingError: A file or folder cannot be made.
            MissingExtraError: A package is not installed.
        """
        _prepare(outputs, out, record)
        self._outputs, self._out, self._began = outputs, out, time.perf_counter()
        kept = out / "mission.npz" if out is not None and recorded else None
        self._records = [file for file in (kept, record) if file is not None]
        self._painter = Painter("rgb_array")
        self._gifs = [file for file in (out and out / "mission.gif", outputs.gif) if file]
        films = {"gif": _GIF_PICTURES if self._gifs else 0, "mp4": _VIDEO_PICTURES if outputs.mp4 else 0}
        self._films = {kind: Film(most) for kind, most in films.items() if most}
        self._followers: list[RerunView | BagWriter] = []
        self._stack = ExitStack()
        self._started = False

    def __enter__(self) -> MissionLog:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.close()

    def _start(self, env: EntropyExploreEnv) -> None:
        self.recorder, self.commands = Recorder(env.missions), CommandRecorder(env.missions)
        for kind, path in ((RerunView, self._outputs.rerun), (BagWriter, self._outputs.bag)):
            if path is not None:
                self._followers.append(self._stack.enter_context(kind(env.missions, path)))
        self._started = True

    def command(self, actions: Mapping[str, Any]) -> None:
        """Note the actions that the next step is given."""
        self.commands.command(actions)

    def note(self, env: EntropyExploreEnv) -> None:
        """Note the moment after the reset or a step."""
        if not self._started:
            self._start(env)
        self.recorder.note()
        self.commands.note()
        for follower in self._followers:
            follower.note()
        if self._films:
            film_moment(env, self._painter, self._films.values())

    def finish(self, strategy: str, **more: Any) -> tuple[dict[str, Any], list[Path]]:  # noqa: ANN401 - JSON
        """Sum the mission up, with further figures, and write the files, each whole or not at all.

        Returns:
            The figures, and what was written.
        """
        figures = mission_figures(self.recorder.missions, 0, floor=True)
        figures = {
            "scenario": figures.pop("scenario"),
            "strategy": strategy,
            **figures,
            **more,
            "wall_s": round(time.perf_counter() - self._began, 3),
        }
        return figures, self._write(figures)

    def _write(self, figures: dict[str, Any]) -> list[Path]:
        outputs, written = self._outputs, []
        if self._out is not None:
            written += self._write_folder(self._out, figures)
        for file in self._gifs:
            animate(self._films["gif"].pictures(_GIF_LAST), file, _GIF_FRAME_S)
            written.append(file)
        if outputs.mp4 is not None:
            write_video(self._films["mp4"].pictures(_VIDEO_LAST), outputs.mp4, _VIDEO_FRAMES_PER_S)
            written.append(outputs.mp4)
        for file in self._records:
            save_record(self.commands.record(figures["strategy"], self._results()), file)
            written.append(file)
        for follower in self._followers:
            follower.finish()
            written.append(follower.path)
        return written

    @cached_property
    def _team_map(self) -> Map:
        """The team's map at the end of the mission."""
        return joint_map(self.recorder.missions)

    def _results(self) -> dict[str, np.ndarray]:
        """Return the arrays that a record keeps for readers: poses over time, and the team's map."""
        series = self.recorder.series()
        arrays = [series.time_s, series.poses]
        if self.recorder.missions.grid.voxels <= MOST_MAP_VOXELS:
            arrays += [self._team_map.mean, self._team_map.precision]
        return dict(zip(RESULTS, arrays, strict=False))

    def _write_folder(self, folder: Path, figures: dict[str, Any]) -> list[Path]:
        """Write figures with their series, the picture of curves and maps, and the map; return the files."""
        from baselines.cli.mission_picture import mission_picture

        recorder, series = self.recorder, self.recorder.series()
        rows = series.sampled(_SERIES_POINTS)
        told = {
            "time_s": series.time_s[rows].tolist(),
            "entropy_bits": series.entropy_bits[rows].tolist(),
            "scans": series.scans.sum(axis=1)[rows].tolist(),
            "shared_measurements": series.shared[rows].tolist(),
        }
        content = {**figures, "settings": settings_of(recorder.missions.scenario), "series": told}
        write_atomically(folder / "mission.json", json.dumps(content, indent=1, allow_nan=False) + "\n")
        strategy = shown_name(figures["strategy"])
        end = self._painter.frame(recorder.missions)
        picture = mission_picture(recorder, end, named(figures), strategy, self._outputs.truth)
        write_atomically(folder / "mission.png", picture)
        name = "map.yaml" if self._team_map.grid.flat else "map.npz"
        maps = save_map(self._team_map, folder / name)
        return [folder / "mission.json", folder / "mission.png", *maps]


def show_results(env: EntropyExploreEnv, figures: dict[str, Any], written: list[Path], as_json: bool) -> None:
    """Print what a mission came to: one JSON object, or a table and the files that were written."""
    if as_json:
        print_json(figures)
        return
    if env.scenario.shares_summaries:
        figures = {**figures, "summaries_sent": int(env.missions.state.summaries["sent"][0].sum())}
    print_table(figures, written, env.scenario)
