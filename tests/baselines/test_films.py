"""`python -m baselines.films`: a small GIF a scenario, the mission from its beginning to its end."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from baselines import films
from baselines.cli.arguments import run_command
from entropy_explore_env.scenarios import BOX, SCENARIOS

ROOT = Path(__file__).parents[2]


def test_every_named_scenario_has_its_film():
    assert {path.stem for path in (ROOT / "docs" / "films").glob("*.gif")} == set(SCENARIOS)


def test_a_film_shows_the_mission_from_beginning_to_end(tmp_path, capsys):
    words = ["--scenarios", "box-7x11x5", "--strategy", "random", "--pictures", "5", "--width", "160"]
    assert run_command(films.main, [*words, "--out", str(tmp_path)]) == 0
    assert "box-7x11x5.gif, " in capsys.readouterr().out
    film = films.filmed(BOX, "random", 0, 5)
    expected = [films.shrunk(picture, 160) for picture in film.pictures(films._LAST)]
    with Image.open(tmp_path / "box-7x11x5.gif") as shown:
        assert shown.size == (160, 120) and 3 <= shown.n_frames <= 5
        first = np.asarray(shown.convert("RGB")).astype(int)
        shown.seek(shown.n_frames - 1)
        last = np.asarray(shown.convert("RGB")).astype(int)
    for picture, made in ((first, expected[0]), (last, expected[-1])):
        assert np.abs(picture - made).mean() < 8.0
    assert np.abs(first - last).mean() > 8.0


def test_shrinking_averages():
    picture = np.zeros((4, 8, 3), np.uint8)
    picture[:2, 2:4] = 200  # a block of 2 × 2 pixels is one of the small picture
    assert films.shrunk(picture, 4)[..., 0].tolist() == [[0, 200, 0, 0], [0, 0, 0, 0]]


def test_unknown_scenarios_are_named(tmp_path, capsys):
    assert run_command(films.main, ["--scenarios", "room,moon", "--out", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err.startswith("error: scenarios = 'moon'") and not (tmp_path / "out").exists()
