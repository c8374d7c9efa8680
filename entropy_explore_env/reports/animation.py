"""Sequences of pictures: in a window, as an animated GIF or WebP, or as a video."""

from __future__ import annotations

import io
import os
import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from entropy_explore_env.errors import SettingError, imported
from entropy_explore_env.settings.validation import is_whole
from entropy_explore_env.writing import write_atomically

COLOUR_CODES = 1 << 15
"""Colours are reduced to 5 bits a channel: not a visible difference, and pictures fit into one palette."""

VIDEO_OPTIONS = {
    "libx264": {"crf": "18", "preset": "medium", "x264-params": "mbtree=0"},
    "mpeg4": {"qscale": "3"},
}
"""What each codec is given. Without `mbtree=0`, x264 reads memory that it never wrote where a processor has
AVX-512, and the same pictures give files that differ."""


def colour_codes(picture: np.ndarray) -> np.ndarray:
    """Return (H, W) uint16: the upper 5 bits of red, green and blue of a picture (H, W, 3) uint8."""
    red, green, blue = np.moveaxis((picture >> 3).astype(np.uint16), -1, 0)
    return red << 10 | green << 5 | blue


def shared_palette(usage: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the 256 most used colours.

    Args:
        usage: (32768,) int64, how often each colour code occurs.

    Returns:
        (256, 3) uint8 the palette, and (32768,) uint8 the place in it of each code's nearest colour.
    """
    used = np.flatnonzero(usage)
    kept = used[np.argsort(-usage[used], kind="stable")][:256]
    levels = np.stack([used >> 10, used >> 5 & 31, used & 31], axis=1).astype(np.int32)
    chosen = np.stack([kept >> 10, kept >> 5 & 31, kept & 31], axis=1).astype(np.int32)
    distances = sum((levels[:, None, c] - chosen[None, :, c]) ** 2 for c in range(3))
    nearest = np.zeros(COLOUR_CODES, dtype=np.uint8)
    nearest[used] = np.argmin(distances, axis=1)
    palette = np.zeros((256, 3), dtype=np.uint8)
    palette[: len(kept)] = chosen << 3 | chosen >> 2
    return palette, nearest


class Film:
    """Pictures that are spread evenly over a mission of any length; kept compressed in memory."""

    def __init__(self, most: int) -> None:
        """Keep at most `most` pictures (≥ 2), and at least half as many once that many were added."""
        self._most = most
        self._kept: list[tuple[float, bytes]] = []
        self._shape: tuple[int, ...] = ()
        self._every_s, self._due_s = 0.1, 0.0

    def due(self, time_s: float) -> bool:
        """Return whether a picture of this moment is wanted."""
        return time_s >= self._due_s

    def add(self, time_s: float, picture: np.ndarray) -> None:
        """Keep a picture (H, W, 3) uint8; if there are too many, every other one is dropped."""
        self._shape = picture.shape
        self._kept.append((time_s, zlib.compress(picture.tobytes(), 1)))
        while len(self._kept) > self._most:
            self._every_s *= 2.0
            last_s, kept = -np.inf, []
            for moment in self._kept:
                if moment[0] >= last_s + 0.999 * self._every_s or moment is self._kept[-1]:
                    kept.append(moment)
                    last_s = moment[0]
            self._kept = kept
        self._due_s = time_s + self._every_s

    def __len__(self) -> int:
        return len(self._kept)

    @property
    def times_s(self) -> list[float]:
        """The moments of the pictures that are kept, in order."""
        return [time_s for time_s, _ in self._kept]

    def picture_at(self, time_s: float) -> np.ndarray:
        """Return the last picture (H, W, 3) uint8 up to a moment; before the first one that one."""
        until = [packed for moment_s, packed in self._kept if moment_s <= time_s]
        return self._unpacked(until[-1] if until else self._kept[0][1])

    def _unpacked(self, packed: bytes) -> np.ndarray:
        return np.frombuffer(zlib.decompress(packed), np.uint8).reshape(self._shape)

    def pictures(self, last: int) -> Iterator[np.ndarray]:
        """Yield the pictures in order, each (H, W, 3) uint8; the last one `last` times."""
        picture = np.zeros(0, np.uint8)
        for _, packed in self._kept:
            picture = self._unpacked(packed)
            yield picture
        for _ in range(last - 1):
            yield picture


class Window:
    """Shows pictures on the screen, with pygame-ce.

    Once the user closes the window, later pictures are not shown.
    """

    def __init__(self, title: str = "entropy_explore_env", frames_per_s: float | None = 30.0) -> None:
        """Prepare a window, which opens with the first picture.

        Args:
            title: Of the window.
            frames_per_s: `show` waits so that it does not exceed this rate; None = it never waits.

        Raises:
            MissingExtraError: pygame-ce is not installed.
        """
        os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
        self._pygame = imported("pygame", "pygame-ce", "render")
        self._title = title
        self._frames_per_s = frames_per_s
        self._screen: Any = None
        self._clock: Any = None
        self.dismissed = False

    def show(self, rgb: np.ndarray) -> None:
        """Show a picture (H, W, 3) uint8 at once; the window takes its size.

        Raises:
            SettingError: There is no display.
        """
        if self.dismissed:
            return
        pygame, size = self._pygame, (rgb.shape[1], rgb.shape[0])
        if self._screen is None or self._screen.get_size() != size:
            try:
                pygame.display.init()
                pygame.display.set_caption(self._title)
                self._screen = pygame.display.set_mode(size)
            except pygame.error as error:
                allowed = (
                    f'"rgb_array" where there is no display ({error}; SDL_VIDEODRIVER=dummy draws nowhere)'
                )
                raise SettingError("render_mode", "human", allowed) from None
            self._clock = self._clock or pygame.time.Clock()
        self._screen.blit(pygame.image.frombuffer(np.ascontiguousarray(rgb), size, "RGB"), (0, 0))
        pygame.display.flip()
        if any(event.type == pygame.QUIT for event in pygame.event.get()):
            self.close()
            self.dismissed = True
        elif self._frames_per_s is not None:
            self._clock.tick(self._frames_per_s)

    def close(self) -> None:
        """Close the window; without one, do nothing."""
        if self._screen is not None:
            self._screen = None
            self._pygame.display.quit()


def animate(frames: Iterable[np.ndarray], path: Path, frame_s: float) -> None:
    """Write pictures as an animated GIF or WebP that repeats for ever; the file appears only when complete.

    All pictures share one palette of 256 colours, made from all of them: with a palette for each picture,
    as Pillow makes them, colours flicker. GIF counts time in 1/100 s; a picture that equals the one before
    only makes that one last longer. WebP keeps the same pixels without loss in a quarter of the bytes.

    Args:
        frames: (H, W, 3) uint8 each, all of one size.
        path: The file, a WebP with the suffix .webp; what it held before is replaced.
        frame_s: Seconds that each picture is shown, at least 0.02.

    Raises:
        SettingError: There are no pictures, or of different sizes, or their time is too short.
    """
    if not frame_s >= 0.02:
        raise SettingError("frame_s", frame_s, "at least 0.02 s")
    packed, usage = [], np.zeros(COLOUR_CODES, dtype=np.int64)
    shape: tuple[int, ...] = ()
    for picture in frames:
        shape = shape or picture.shape
        if picture.shape != shape:
            raise SettingError("frames", picture.shape, f"pictures of one shape, {shape}")
        codes = colour_codes(picture)
        usage += np.bincount(codes.ravel(), minlength=COLOUR_CODES)
        packed.append(zlib.compress(codes.tobytes(), 1))
    if not packed:
        raise SettingError("frames", "none", "at least one picture")
    palette, nearest = shared_palette(usage)
    webp = path.suffix.lower() == ".webp"

    def pictures() -> Iterator[Image.Image]:
        for data in packed:
            codes = np.frombuffer(zlib.decompress(data), dtype=np.uint16).reshape(shape[:2])
            image = Image.fromarray(nearest[codes])
            image.putpalette(palette.tobytes())
            yield image.convert("RGB") if webp else image

    animation = pictures()
    options: dict[str, Any] = {"append_images": animation, "duration": round(1000 * frame_s), "loop": 0}
    options |= {"lossless": True, "method": 4} if webp else {"optimize": False}
    buffer = io.BytesIO()
    next(animation).save(buffer, format="WEBP" if webp else "GIF", save_all=True, **options)
    write_atomically(path, buffer.getvalue())


def write_video(frames: Iterable[np.ndarray], path: Path, frames_per_s: int) -> None:
    """Write pictures as an MP4: H.264 where the installed PyAV has it, MPEG-4 otherwise.

    The same pictures give the same file. It appears only when complete.

    Args:
        frames: (H, W, 3) uint8 each, all of one size; an odd row or column at the end is left out.
        path: The file; what it held before is replaced.
        frames_per_s: From 1 to 240.

    Raises:
        SettingError: There are no pictures, or of different sizes, or too many a second.
        MissingExtraError: PyAV is not installed.
    """
    av = imported("av", "av", "viewer")
    if not is_whole(frames_per_s, 1, 240):
        raise SettingError("frames_per_s", frames_per_s, "a whole number from 1 to 240")
    buffer, shape = io.BytesIO(), (0, 0, 3)
    stream: Any = None
    with av.open(buffer, "w", format="mp4") as video:
        for picture in frames:
            if stream is None:
                shape = picture.shape
                codec = "libx264" if "libx264" in av.codecs_available else "mpeg4"
                stream = video.add_stream(codec, rate=frames_per_s)
                stream.height, stream.width = shape[0] - shape[0] % 2, shape[1] - shape[1] % 2
                stream.pix_fmt = "yuv420p"
                stream.thread_count = 1  # more of them: slices, and so the file, depend on their number
                stream.options = VIDEO_OPTIONS[codec]
            if picture.shape != shape:
                raise SettingError("frames", picture.shape, f"pictures of one shape, {shape}")
            even = np.ascontiguousarray(picture[: stream.height, : stream.width])
            video.mux(stream.encode(av.VideoFrame.from_ndarray(even, format="rgb24")))
        if stream is None:
            raise SettingError("frames", "none", "at least one picture")
        video.mux(stream.encode())
    write_atomically(path, buffer.getvalue())
