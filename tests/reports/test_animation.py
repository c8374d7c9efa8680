"""Films that thin themselves out, and videos read back with PyAV."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from entropy_explore_env.errors import MissingExtraError, SettingError
from entropy_explore_env.reports.animation import Film, write_video
from tests.reference.scenes import drawn


def picture(number: int, shape: tuple[int, int] = (48, 64)) -> np.ndarray:
    """A dark picture with a bright square that has moved `number` pixels to the right."""
    image = np.full((*shape, 3), 20, np.uint8)
    image[10:30, number : number + 12] = (250, 240, 60)
    return image


def filmed(times_s: list[float], most: int) -> list[float]:
    """The moments that a film keeps, written into its pictures."""
    film = Film(most)
    for number, time_s in enumerate(times_s):
        if film.due(time_s) or number == len(times_s) - 1:
            film.add(time_s, np.full((1, 1, 3), number % 256, np.uint8))
        assert len(film) <= most
    return [time_s for time_s, _ in film._kept]


@drawn(60)
@given(
    gaps=st.lists(st.floats(0.2, 7.0), min_size=1, max_size=250),
    most=st.integers(2, 40),
)
def test_a_film_keeps_both_ends_and_spreads_the_rest(gaps, most):
    times = np.cumsum([0.0, *gaps]).tolist()
    kept = filmed(times, most)
    assert kept[0] == 0.0 and kept[-1] == times[-1]
    assert kept == sorted(set(kept)) and len(kept) <= most
    if len(times) <= most:
        assert kept == times
    else:
        widest = max(np.diff(kept))
        assert widest <= 4.0 * times[-1] / max(most - 1, 1) + 2 * max(gaps)


def test_a_long_film_is_evenly_spread():
    kept = np.diff(filmed([0.5 * n for n in range(2001)], 50))
    assert len(kept) >= 24 and kept[:-1].max() <= 1.5 * kept[:-1].min()


def test_a_film_gives_back_its_pictures_the_last_one_longer():
    film = Film(10)
    for number in range(4):
        film.add(float(number), picture(number))
    shown = list(film.pictures(last=3))
    assert len(shown) == 6 == len(film) + 2
    for number, image in zip((0, 1, 2, 3, 3, 3), shown, strict=True):
        np.testing.assert_array_equal(image, picture(number))


def decoded(path: Path) -> tuple[list[np.ndarray], float, str]:
    """Pictures, pictures a second, and codec of a video."""
    av = pytest.importorskip("av")
    with av.open(str(path)) as video:
        stream = video.streams.video[0]
        images = [frame.to_ndarray(format="rgb24") for frame in video.decode(stream)]
        return images, float(stream.average_rate), stream.codec_context.name


@pytest.mark.parametrize("missing", [(), ("libx264",)])
def test_a_video_has_every_picture(missing, tmp_path, monkeypatch):
    """Also where PyAV lacks H.264."""
    av = pytest.importorskip("av")
    monkeypatch.setattr(av, "codecs_available", av.codecs_available - set(missing))
    path = tmp_path / "mission.mp4"
    write_video((picture(number) for number in range(12)), path, 20)
    images, rate, codec = decoded(path)
    assert (len(images), rate) == (12, 20.0)
    assert codec == ("h264" if not missing and "libx264" in av.codecs_available else "mpeg4")
    for number, image in enumerate(images):
        assert image.shape == (48, 64, 3)
        assert np.abs(image.astype(int) - picture(number)).mean() < 6.0
    assert [entry.name for entry in tmp_path.iterdir()] == ["mission.mp4"]


FILMED_IN_USED_MEMORY = """
import hashlib, sys
from pathlib import Path
import numpy as np
from entropy_explore_env.reports.animation import write_video

draw = np.random.default_rng(0)
pictures = [np.full((48, 64, 3), 20, np.uint8) for _ in range(5)]
for number, picture in enumerate(pictures):
    picture[10:30, number : number + 12] = (250, 240, 60)

def in_used_memory():
    for picture in pictures:
        byte = draw.choice([0, 127, 128, 255])
        blocks = [np.full(size, byte, np.uint8) for size in draw.integers(16, 200_000, 300)]
        del blocks
        yield picture

for _ in range(12):
    write_video(in_used_memory(), Path(sys.argv[1]), 10)
    print(hashlib.md5(Path(sys.argv[1]).read_bytes()).hexdigest())
"""


def test_the_same_pictures_give_the_same_file(tmp_path):
    """Whatever lay in the memory that the encoder is given."""
    pytest.importorskip("av")
    words = [sys.executable, "-c", FILMED_IN_USED_MEMORY, str(tmp_path / "a.mp4")]
    never_fresh = {"MALLOC_MMAP_THRESHOLD_": str(1 << 30)}
    ran = subprocess.run(words, capture_output=True, text=True, env={**os.environ, **never_fresh}, check=True)
    digests = ran.stdout.split()
    assert len(digests) == 12 and len(set(digests)) == 1


def test_odd_sizes_lose_a_row_or_a_column(tmp_path):
    pytest.importorskip("av")
    write_video([picture(3, (49, 65))], tmp_path / "a.mp4", 10)
    (image,), _, _ = decoded(tmp_path / "a.mp4")
    assert image.shape == (48, 64, 3)


def test_a_video_that_fails_leaves_the_old_file(tmp_path):
    pytest.importorskip("av")
    path = tmp_path / "mission.mp4"
    path.write_bytes(b"old")
    wrong = (([], 10), ([picture(0), picture(0)[:20]], 10), ([picture(0)], 0), ([picture(0)], 2.5))
    for frames, rate in wrong:
        with pytest.raises(SettingError):
            write_video(frames, path, rate)
    assert path.read_bytes() == b"old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["mission.mp4"]


def test_without_pyav_the_extra_is_named(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(MissingExtraError, match=r"\[viewer\]"):
        write_video([picture(0)], tmp_path / "a.mp4", 10)
