"""How commands end: one line for an error, exit codes; the library's and those of the checkout alike."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from pathlib import Path

import pytest

from baselines.cli import arguments as checkout
from entropy_explore_env import command
from entropy_explore_env.command import BAD_INPUT, INTERRUPTED, LineParser, UsageError
from entropy_explore_env.errors import CallOrderError, SettingError, WorldError
from entropy_explore_env.starting import is_command
from tests.systems import needs_posix


@pytest.fixture(params=[command.run_command, checkout.run_command], ids=["library", "checkout"])
def run(request):
    return request.param


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (SettingError("speed", -1, "a number > 0"), BAD_INPUT, "error: speed = -1: expected a number > 0"),
        (WorldError("world", "x", "another"), BAD_INPUT, "error: world = 'x': expected another"),
        (CallOrderError("not\n  yet"), BAD_INPUT, "error: not yet"),
        (FileNotFoundError(2, "No such file", "a.bt"), BAD_INPUT, "error: a.bt: No such file"),
        (MemoryError("8 EiB"), BAD_INPUT, "error: not enough memory: 8 EiB"),
        (KeyboardInterrupt(), INTERRUPTED, "interrupted"),
    ],
)
def test_an_error_becomes_one_line_on_standard_error_and_a_code(run, error, code, line, capsys):
    def main(words):
        raise error

    assert run(main, []) == code
    assert capsys.readouterr() == ("", line + "\n")


def test_our_mistakes_are_not_taken_for_bad_input(run):
    with pytest.raises(ZeroDivisionError):
        run(lambda words: 1 // len(words), [])


def test_the_code_is_that_of_the_command_and_the_words_those_of_the_process(run, monkeypatch):
    monkeypatch.setattr("sys.argv", ["command", "a", "b"])
    assert run(lambda words: len(words)) == 2
    assert run(lambda words: len(words), ["x"]) == 1


def test_a_reader_that_has_seen_enough_is_no_error(run, capsys, monkeypatch):
    def main(words):
        raise BrokenPipeError

    monkeypatch.setattr(sys, "stdout", sys.stdout)  # it is replaced
    before = sys.stdout
    assert run(main, []) == 0 and sys.stdout is not before
    sys.stdout.close()
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("words", [[], ["--number", "many"], ["stray"], ["--number", "3", "--wings"]])
def test_words_that_do_not_fit_are_one_line(words, capsys):
    parser = LineParser("count")
    parser.add_argument("--number", type=int, required=True)
    with pytest.raises(UsageError) as error:
        parser.parse_args(words)
    assert "\n" not in str(error.value) and "--help" in str(error.value)
    assert capsys.readouterr() == ("", "")


def test_a_terminal_that_lacks_characters_gets_question_marks(run, monkeypatch):
    out, err = (io.TextIOWrapper(io.BytesIO(), "ascii") for _ in range(2))
    monkeypatch.setattr(sys, "stdout", out)
    monkeypatch.setattr(sys, "stderr", err)

    def main(words):
        print("σ = 0.03 …")
        raise WorldError("maße", "Ω", "×")

    assert run(main, []) == BAD_INPUT
    for stream, expected in ((out, b"? = 0.03 ?\n"), (err, b"error: ma?e = '?': expected ?\n")):
        stream.flush()
        assert stream.buffer.getvalue() == expected


def test_the_help_of_a_command_comes_out_on_a_terminal_of_ascii():
    variables = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "PYTHONIOENCODING": "ascii"}
    words = [sys.executable, "-m", "baselines.run", "--help"]
    done = subprocess.run(words, env=variables, capture_output=True, timeout=120)
    assert done.returncode == 0, done.stderr.decode()
    assert b"--help" in done.stdout and b"Traceback" not in done.stderr


def started(module, needed, folder, does):
    """A command in a process of its own, where a package that it needs does something when it is imported."""
    (folder / f"{needed}.py").write_text(f"import os, signal\n{does}\n")
    paths = os.pathsep.join((str(folder), *sys.path))
    words = [sys.executable, "-m", module, "--help"]
    return subprocess.run(
        words, env={**os.environ, "PYTHONPATH": paths}, capture_output=True, text=True, timeout=120
    )


@needs_posix
@pytest.mark.parametrize(
    ("module", "needed"),
    [
        ("baselines.run", "docstring_parser"),
        ("training.ppo", "torch"),
        ("benchmarks.speed", "gymnasium"),
        ("entropy_explore_env", "gymnasium"),
    ],
)
def test_ctrl_c_while_a_command_is_importing_is_one_line(module, needed, tmp_path):
    heard = "signal.signal(signal.SIGINT, signal.default_int_handler)"  # who starts the tests may ignore it
    done = started(module, needed, tmp_path, f"{heard}; os.kill(os.getpid(), signal.SIGINT)")
    assert (done.returncode, done.stdout, done.stderr) == (INTERRUPTED, "", "interrupted\n")


def test_a_mistake_while_a_command_is_importing_is_shown_in_full(tmp_path):
    done = started("baselines.run", "docstring_parser", tmp_path, "1 // 0")
    assert done.returncode == 1 and done.stderr.startswith("Traceback") and "ZeroDivision" in done.stderr


def test_who_imports_the_library_gets_no_hook():
    script = "import sys, baselines; assert sys.excepthook is sys.__excepthook__"
    done = subprocess.run([sys.executable, "-c", script], cwd=Path(__file__).parents[1], check=False)
    assert done.returncode == 0
    assert is_command("/usr/bin/entropy-explore-warm") and is_command("-m")
    assert not is_command("-c") and not is_command("/home/me/train.py") and not is_command("")


def test_whole_numbers_have_exponents_and_paths_begin_at_home(monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    parser = LineParser("count")
    parser.add_argument("--number", type=int)
    parser.add_argument("folder", type=Path)
    commands = LineParser("both").add_subparsers()
    part = commands.add_parser("part")
    part.add_argument("--number", type=int)
    assert isinstance(part, LineParser) and part.parse_args(["--number", "2e3"]).number == 2000
    given = parser.parse_args(["--number", "1e6", "~/maps"])
    assert given.number == 1_000_000 and type(given.number) is int and given.folder == tmp_path / "maps"
    for words in (["--number", "1.5", "a"], ["~nobody-of-this-name/a"]):
        with pytest.raises(UsageError):
            parser.parse_args(words)
