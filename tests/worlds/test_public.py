"""Public worlds: found or fetched, or refused in one line that says what to do; no network is needed."""

from __future__ import annotations

import functools
import hashlib
import http.server
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from benchmarks.proofs.world_samples import pgm, sketch
from entropy_explore_env.command import run_command
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import MissingExtraError, SettingError, WorldError
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import SCENARIOS
from entropy_explore_env.worlds.commands import main
from entropy_explore_env.worlds.load import load_world
from entropy_explore_env.worlds.public import fetching
from entropy_explore_env.worlds.public.fetching import FOLDER_VARIABLE, found_file, public_folder
from entropy_explore_env.worlds.public.table import PUBLIC, PublicWorld
from entropy_explore_env.worlds.recipes.catalogue import RECIPES
from tests.public_worlds import needs_public_worlds

NAME, SOURCE = "willow", PUBLIC["willow"].source
PLAN, YAML = pgm(sketch()), b"image: plan.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n"
YAML += b"occupied_thresh: 0.65\nfree_thresh: 0.2\n"
FILES = {"plan.yaml": YAML, "plan.pgm": PLAN}


class Answers(http.server.BaseHTTPRequestHandler):
    """Serves the files of a world, or spoils them as `how` says."""

    how = "whole"
    asked: list[str]

    def do_GET(self):
        self.asked.append(self.path)
        name = Path(self.path).name
        if self.how == "refused":
            self.send_error(404)
            return
        content = FILES[name]
        self.send_response(200)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        if self.how == "wrong":
            content = content[::-1]
        self.wfile.write(content[: len(content) // 2] if self.how == "cut" else content)

    def log_message(self, *_):
        """Say nothing."""


@pytest.fixture
def server(monkeypatch, tmp_path):
    """A server on this machine that has a small world, by the name of a public one, and an empty folder."""
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path / "worlds"))
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    handler = type("Handler", (Answers,), {"asked": []})
    # It answers in the one thread, which is joined, so that all its sockets are closed.
    with http.server.HTTPServer(("127.0.0.1", 0), handler) as serving:
        thread = threading.Thread(target=functools.partial(serving.serve_forever, poll_interval=0.01))
        thread.start()
        monkeypatch.setattr(fetching, "HOST", f"http://127.0.0.1:{serving.server_port}")
        files = {name: hashlib.sha256(content).hexdigest() for name, content in FILES.items()}
        small = PublicWorld("a plan", SOURCE, files, Grid((11, 7, 1), 0.05))
        for module in ("load", "public.fetching"):
            monkeypatch.setattr(f"entropy_explore_env.worlds.{module}.PUBLIC", {**PUBLIC, NAME: small})
        yield handler
        serving.shutdown()
        thread.join()


def left_over(folder: Path) -> list[Path]:
    """Files in the folder of worlds."""
    return [path for path in folder.rglob("*") if path.is_file()]


def test_a_world_is_fetched_once_and_checked(server, tmp_path):
    world = load_world(NAME)
    assert (world.name, world.grid.voxel_size_m) == (NAME, 0.05) and world.occupied.any()
    own = tmp_path / "worlds" / SOURCE.name
    assert {path.name: path.read_bytes() for path in own.iterdir()} == FILES
    assert server.asked == [f"/{SOURCE.folder}/{name}" for name in FILES]
    assert np.array_equal(load_world(NAME).occupied, world.occupied) and len(server.asked) == len(FILES)
    (own / "plan.pgm").write_bytes(PLAN[:-1])  # somebody spoils it
    load_world(NAME)
    assert (own / "plan.pgm").read_bytes() == PLAN and len(server.asked) == len(FILES) + 1


def test_files_that_lie_somewhere_in_the_folder_are_not_fetched(server, tmp_path):
    wrong, right = (tmp_path / "worlds" / name for name in ("a", "b/maps"))
    for folder, plan in ((wrong, PLAN + b"\n"), (right, PLAN)):
        folder.mkdir(parents=True)
        (folder / "plan.yaml").write_bytes(YAML)
        (folder / "plan.pgm").write_bytes(plan)
    server.how = "refused"
    assert load_world(NAME).occupied.any() and server.asked == []
    assert fetching.public_file(NAME) == right / "plan.yaml"


@pytest.mark.parametrize(
    ("how", "reason"),
    [
        ("refused", "the server answers 404"),
        ("wrong", "what the server sent has another SHA-256 than the pinned file"),
        ("cut", "the transfer broke off"),
        ("off", "there is no connection"),
    ],
)
def test_what_cannot_be_fetched_is_one_line_and_leaves_nothing(
    server, monkeypatch, tmp_path, capsys, how, reason
):
    server.how = how
    if how == "off":
        monkeypatch.setattr(fetching, "HOST", "http://127.0.0.1:9")
    expected = f"world = 'willow': expected plan.yaml and plan.pgm, which could not be fetched: {reason} ("
    with pytest.raises(WorldError) as error:
        load_world(NAME)
    assert str(error.value).startswith(expected)
    assert str(error.value).endswith(f"put what is missing into a folder, and set {FOLDER_VARIABLE} to it")
    assert run_command(main, ["show", NAME, "--out", str(tmp_path / "world.png")]) == 2
    said = capsys.readouterr()
    assert said.err.startswith(f"error: {expected}") and said.err.count("\n") == 1 and said.out == ""
    with pytest.raises(WorldError, match="could not be fetched"):
        EntropyExploreEnv("office", world=NAME)
    assert left_over(tmp_path) == []


def test_a_folder_that_cannot_be_written_is_named(server, monkeypatch, tmp_path):
    (tmp_path / "file").write_bytes(b"")
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path / "file"))
    with pytest.raises(WorldError, match=r"could not be fetched: .*file"):
        load_world(NAME)


def test_the_extra_that_fetches_is_named_where_it_is_missing(server, monkeypatch):
    monkeypatch.setitem(sys.modules, "pooch", None)
    with pytest.raises(MissingExtraError, match=r"pooch is not installed: pip install .*\[baselines\]"):
        load_world(NAME)


def test_the_folder_is_the_user_s_cache_or_that_of_the_variable(monkeypatch, tmp_path):
    monkeypatch.setenv(FOLDER_VARIABLE, "~/worlds")
    assert public_folder() == Path.home() / "worlds"
    monkeypatch.delenv(FOLDER_VARIABLE)
    assert public_folder().parts[-2:] == ("entropy_explore_env", "worlds")


def test_names_cannot_be_mistaken_and_similar_ones_are_named():
    assert not any("." in name or "/" in name for name in PUBLIC)
    assert not set(PUBLIC) & {*RECIPES, *SCENARIOS, "jacksboro"}
    with pytest.raises(WorldError, match="did you mean octa_maze"):
        load_world("octa-maze")
    with pytest.raises(SettingError, match=r"Scenario.world = .willo.: .*did you mean willow"):
        EntropyExploreEnv("office", world="willo")
    with pytest.raises(WorldError, match="did you mean geb079"):
        fetching.public_file("geb79")


def test_every_entry_of_the_table_is_whole():
    for name, world in PUBLIC.items():
        assert world.about and world.source.licence and world.source.citation, name
        assert all(len(digest) == 64 and int(digest, 16) for digest in world.files.values()), name
        assert len(world.source.folder.split("/")[2]) == 40, name  # a commit
        if world.start_m is not None:
            assert world.grid.voxel_of(np.array([*world.start_m, 0.5 * world.grid.voxel_size_m])) is not None


@pytest.mark.parametrize("name", [*list(PUBLIC)[:7], "dungeon-1", "dungeon-100"])
def test_a_real_world_has_the_grid_of_the_table(name):
    needs_public_worlds(name)
    world = load_world(name)
    assert (world.grid, world.name) == (PUBLIC[name].grid, name)
    assert found_file(PUBLIC[name], public_folder()) is not None
