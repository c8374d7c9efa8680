"""Text in pictures: Pillow's built-in font (Aileron), and how text is made to fit into it and into a line."""

from __future__ import annotations

import unicodedata
from functools import lru_cache

from PIL import ImageFont


@lru_cache(maxsize=16)
def font(size: int) -> ImageFont.FreeTypeFont:
    """Return the font at a size in pixels."""
    return ImageFont.load_default(size)  # type: ignore[return-value] - with a size it is a FreeType font


@lru_cache(maxsize=1024)
def printable(text: str) -> str:
    """Return the text in characters that the font has: accents are dropped, other characters become `?`."""
    return "".join(_printable_character(character) for character in text)


def _printable_character(character: str) -> str:
    if character == "…":
        return character
    plain, *marks = unicodedata.normalize("NFKD", character)
    return plain if " " <= plain <= "~" and all(map(unicodedata.combining, marks)) else "?"


def text_width(text: str, size: int) -> float:
    """Return the width of a line of printable text in pixels."""
    return font(size).getlength(text)


@lru_cache(maxsize=1024)
def shortened(text: str, width: float, size: int) -> str:
    """Return the text in printable characters, cut off with `…` where it is wider than `width` pixels."""
    text = printable(text)
    if text_width(text, size) <= width:
        return text
    kept = text
    while kept and text_width(kept + "…", size) > width:
        kept = kept[:-1]
    return kept.rstrip() + "…"
