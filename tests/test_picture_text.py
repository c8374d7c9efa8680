"""Text fits into its line and uses only characters that the font has."""

from __future__ import annotations

from entropy_explore_env.picture_text import font, printable, shortened, text_width


def test_every_printable_character_has_a_glyph_of_its_own():
    missing = bytes(font(20).getmask("\uffff"))
    characters = [chr(code) for code in range(33, 127)] + ["…"]
    glyphs = [bytes(font(20).getmask(character)) for character in characters]
    assert missing not in glyphs
    assert printable("".join(characters)) == "".join(characters)


def test_other_characters_lose_their_accents_or_become_question_marks():
    assert printable("Café Zürich: 漢 × 2² ½") == "Cafe Zurich: ? ? 22 ?"
    assert printable("") == ""


def test_text_is_shortened_to_its_line():
    text = "remaining entropy of the café"
    assert shortened("short", 500, 12) == "short"
    assert shortened(text, 500, 12) == "remaining entropy of the cafe"
    for width in (20, 50, 90):
        cut = shortened(text, width, 12)
        assert cut.endswith("…") and text.startswith(cut[:-1].rstrip())
        assert text_width(cut, 12) <= width < text_width(text[: len(cut) + 1] + "…", 12)
    assert text_width(text[:9], 24) > 1.8 * text_width(text[:9], 12)
