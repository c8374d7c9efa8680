"""Films that thin themselves out, animations and videos read back, and the window that shows them."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pygame
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image, ImageSequence

from entropy_explore_env.errors import MissingExtraError, SettingError
from entropy_explore_env.reports.animation import Film, Window, animate, write_video
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
@given(gaps=st.lists(st.floats(0.2, 7.0), min_size=1, max_size=250), most=st.integers(2, 40))
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

for _ in range(4):
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
    assert len(digests) == 4 and len(set(digests)) == 1


def test_odd_sizes_lose_a_row_or_a_column(tmp_path):
    pytest.importorskip("av")
    write_video([picture(3, (49, 65))], tmp_path / "a.mp4", 10)
    (image,), _, _ = decoded(tmp_path / "a.mp4")
    assert image.shape == (48, 64, 3)


@pytest.mark.parametrize(
    ("write", "name", "good", "bad"),
    [(animate, "mission.gif", 0.1, (0.0, float("nan"))), (write_video, "mission.mp4", 10, (0, 2.5))],
)
def test_a_film_that_fails_leaves_the_old_file(write, name, good, bad, tmp_path):
    if write is write_video:
        pytest.importorskip("av")
    path = tmp_path / name
    path.write_bytes(b"old")
    wrong = [([], good), ([picture(0), picture(0)[:20]], good), *(([picture(0)], rate) for rate in bad)]
    for frames, rate in wrong:
        with pytest.raises(SettingError):
            write(frames, path, rate)
    assert path.read_bytes() == b"old"
    assert [entry.name for entry in tmp_path.iterdir()] == [name]


def test_without_pyav_the_extra_is_named(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(MissingExtraError, match=r"\[viewer\]"):
        write_video([picture(0)], tmp_path / "a.mp4", 10)


def test_animation_has_every_picture_and_one_palette(tmp_path: Path) -> None:
    pictures, path = [picture(number) for number in range(6)], tmp_path / "mission.gif"
    animate(iter(pictures), path, 0.05)
    assert [entry.name for entry in tmp_path.iterdir()] == ["mission.gif"]
    with Image.open(path) as animation:
        assert animation.n_frames == 6 and animation.size == (64, 48)
        assert animation.info["loop"] == 0
        for nth, shown in enumerate(pictures):
            animation.seek(nth)
            assert animation.info["duration"] == 50
            seen = np.asarray(animation.convert("RGB")).astype(int)
            assert np.abs(seen - shown).max() <= 8


def test_a_webp_has_the_pixels_of_the_gif(tmp_path: Path) -> None:
    pictures = [picture(number) for number in (0, 5, 10)]
    shown = []
    for suffix in ("gif", "webp"):
        animate(pictures, tmp_path / f"mission.{suffix}", 0.05)
        with Image.open(tmp_path / f"mission.{suffix}") as animation:
            shown.append([np.asarray(each.convert("RGB")) for each in ImageSequence.Iterator(animation)])
    np.testing.assert_array_equal(*shown)


def test_window_shows_pictures_and_a_person_can_close_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    window = Window(frames_per_s=None)
    window.close()
    first = picture(0)
    window.show(first)
    shown = pygame.surfarray.array3d(pygame.display.get_surface()).swapaxes(0, 1)
    np.testing.assert_array_equal(shown, first)
    window.show(picture(0, (600, 800)))
    assert pygame.display.get_surface().get_size() == (800, 600)
    window.close()
    assert not pygame.display.get_init()
    window.show(first)
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    window.show(first)
    assert window.dismissed
    window.show(first)
    assert not pygame.display.get_init()


def test_without_a_display_one_line_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "none of this name")
    with pytest.raises(SettingError, match=r"render_mode = 'human': .*\"rgb_array\" .*SDL_VIDEODRIVER=dummy"):
        Window().show(np.zeros((40, 60, 3), np.uint8))


def test_window_holds_its_frame_rate(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    window, picture = Window(frames_per_s=50.0), np.zeros((40, 60, 3), np.uint8)
    window.show(picture)
    begin = pygame.time.get_ticks()
    for _ in range(5):
        window.show(picture)
    assert pygame.time.get_ticks() - begin >= 80
    window.close()


def test_without_pygame_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(MissingExtraError, match=r"\[render\]"):
        Window()
