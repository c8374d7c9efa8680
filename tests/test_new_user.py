"""The script of a new user's first hour: its steps, and what it says of a failure."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests import new_user
from tests.code_blocks import Block
from tests.new_user import User, main


def test_a_step_that_fails_ends_it_and_leaves_the_folder(tmp_path, monkeypatch, capsys):
    ran = []

    def good(user: User) -> None:
        """Does what it should."""
        ran.append(user.call([sys.executable, "-c", "print('hello')"]))

    def bad(user: User) -> None:
        """Does not."""
        user.call([sys.executable, "-c", "print('why'); raise SystemExit(3)"])

    def never(user: User) -> None:
        """Is not reached."""
        raise AssertionError(user)

    monkeypatch.setattr(new_user, "STEPS", (good, bad, never))
    monkeypatch.setattr(new_user.tempfile, "mkdtemp", lambda **_: str(tmp_path))
    assert main(["--borrow"]) == 1
    said = capsys.readouterr().err
    assert ran == ["hello\n"] and "bad failed: " in said and "exit code 3, not 0\nwhy\n" in said
    assert f"the folder stays: {tmp_path}" in said and tmp_path.is_dir()
    monkeypatch.setattr(new_user, "STEPS", (good,))
    assert main([]) == 0 and not tmp_path.exists()
    with pytest.raises(SystemExit, match="2"):
        main(["--skip", "dinner"])


def test_examples_of_packages_that_are_not_there_are_skipped(tmp_path, monkeypatch, capsys):
    user = User(tmp_path, borrow=True)
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(user.environment)], check=True)
    assert user.can_import("json.decoder") and not user.can_import("json.moon")
    written = (("here", "import json\nopen('ran', 'w').close()"), ("there", "from benchmarl.run import x"))
    monkeypatch.setattr(new_user, "blocks", lambda: [Block(*each) for each in written])
    new_user.examples(user)
    assert "there: skipped, benchmarl.run is not installed here" in capsys.readouterr().err
    assert [path.parent.name for path in tmp_path.glob("examples/*/ran")] == ["here"]


@pytest.mark.long
def test_the_first_hour_works(capsys):
    """All but the examples and the site, which tests of their own run."""
    assert main(["--borrow", "--skip", "examples,site"]) == 0, capsys.readouterr().err
