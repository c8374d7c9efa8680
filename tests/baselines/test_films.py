"""`python -m baselines.films`: a small WebP a scenario, the mission from its beginning to its end."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from baselines import films
from baselines.cli.arguments import run_command
from entropy_explore_env.reports.animation import Film
from entropy_explore_env.settings.scenarios import BOX, SCENARIOS

ROOT = Path(__file__).parents[2]


def test_every_named_scenario_has_its_film():
    assert {path.stem for path in (ROOT / "docs" / "films").glob("*.webp")} == set(SCENARIOS)


def test_a_film_shows_the_mission_from_beginning_to_end(tmp_path, capsys):
    words = ["--scenarios", "box-7x11x5", "--strategy", "random", "--pictures", "5", "--width", "160"]
    assert run_command(films.main, [*words, "--out", str(tmp_path)]) == 0
    assert "box-7x11x5.webp, " in capsys.readouterr().out
    film = films.filmed(BOX, "random", 0, 5)
    expected = [films.shrunk(picture, 160) for picture in film.pictures(films._LAST)]
    with Image.open(tmp_path / "box-7x11x5.webp") as shown:
        assert shown.size == (160, 120) and 3 <= shown.n_frames <= 5
        first = np.asarray(shown.convert("RGB")).astype(int)
        shown.seek(shown.n_frames - 1)
        last = np.asarray(shown.convert("RGB")).astype(int)
    for picture, made in ((first, expected[0]), (last, expected[-1])):
        assert np.abs(picture - made).mean() < 8.0
    assert np.abs(first - last).mean() > 8.0


def test_two_missions_run_beside_each_other_on_one_clock(tmp_path, capsys):
    words = "--scenarios box-7x11x5 --strategy random --beside planned-rate --pictures 6 --width 160".split()
    assert run_command(films.main, [*words, "--out", str(tmp_path)]) == 0
    assert "box-7x11x5-random-planned-rate.webp, " in capsys.readouterr().out
    slow, quick = (films.filmed(BOX, strategy, 0, 6) for strategy in ("random", "planned-rate"))
    assert quick.times_s[-1] < slow.times_s[-1]
    pictures = list(films.beside_each_other([slow, quick], ["random", "planned-rate"], 160))
    assert len(pictures) == len(slow.times_s) + films._LAST - 1
    assert {picture.shape for picture in pictures} == {(136, 320, 3)}  # 120 rows below two of 8 pixels
    for picture, time_s in zip(pictures, slow.times_s, strict=False):
        for film, columns in ((slow, slice(0, 160)), (quick, slice(160, 320))):
            shown = films.shrunk(film.picture_at(time_s), 160)
            np.testing.assert_array_equal(picture[16:, columns], shown)
    with Image.open(tmp_path / "box-7x11x5-random-planned-rate.webp") as shown:
        assert shown.size == (320, 136)


def test_a_film_holds_the_last_picture_up_to_a_moment():
    film = Film(4)
    for time_s in (1.0, 2.0, 5.0):
        film.add(time_s, np.full((2, 3, 3), int(time_s), np.uint8))
    assert film.times_s == [1.0, 2.0, 5.0]
    assert [int(film.picture_at(time_s)[0, 0, 0]) for time_s in (0.0, 1.0, 4.9, 5.0, 9.0)] == [1, 1, 2, 5, 5]


def test_shrinking_averages():
    picture = np.zeros((4, 8, 3), np.uint8)
    picture[:2, 2:4] = 200  # a block of 2 × 2 pixels is one of the small picture
    assert films.shrunk(picture, 4)[..., 0].tolist() == [[0, 200, 0, 0], [0, 0, 0, 0]]
