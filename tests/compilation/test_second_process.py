"""A second process compiles from the other end what the first one needs, and ends with it."""

import os
import time

import pytest

from entropy_explore_env.compilation import second_process
from tests.compilation.test_kernels import run, start
from tests.systems import needs_posix

LEAVES = 12
CODE = "from entropy_explore_env.compilation.kernels import lean_kernel\n"
for number in range(LEAVES):
    CODE += f"\n\n@lean_kernel\ndef leaf{number}(x):\n    return x + {number}\n"
CALLS = " + ".join(f"leaf{number}(x)" for number in range(LEAVES))
CODE += f"\n\n@lean_kernel\ndef caller(x):\n    return {CALLS}\n"
ASK = """
import time
from pathlib import Path
from entropy_explore_env.compilation import second_process
from entropy_explore_env.compilation.announcement import compiled_kernels
from entropy_explore_env.compilation.kernels import compile_ahead
from mine import caller

second_process._processors = lambda: {processors}
compile_ahead([(caller, (1.0,))])
until_s = time.monotonic() + {patience_s}
while not list(Path("cache").rglob("mine.caller-*.kernel")) and time.monotonic() < until_s:
    time.sleep(0.05)
print(second_process.shared(), caller(1.0), len(compiled_kernels()), flush=True)
"""
WAIT = "print(second_process._helper.process.pid, flush=True)\ninput()\n"
REVERSED = "from entropy_explore_env.compilation import second_process\nsecond_process._helper.serving = {}\n"
REVERSED += "from mine import caller\nprint(caller(1.0))"


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "mine.py").write_text(CODE)
    return tmp_path


@needs_posix
def test_the_helper_compiles_what_the_process_calls_later(folder):
    said = run(ASK.format(processors=2, patience_s=100.0), folder)
    assert said == f"True {LEAVES + sum(range(LEAVES)):.1f} 0"
    assert not list(folder.rglob("*.claim"))


@needs_posix
def test_it_ends_with_the_process(folder):
    process = start(ASK.format(processors=2, patience_s=100.0) + WAIT, folder)
    assert process.stdout is not None and process.stdout.readline().startswith("True")
    pid = int(process.stdout.readline())
    os.kill(pid, 0)
    process.kill()
    process.communicate()
    until_s = time.monotonic() + 30.0
    while time.monotonic() < until_s:
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return
        time.sleep(0.05)
    raise AssertionError("the helper goes on alone")


def test_one_processor_has_no_helper(folder):
    said = run(ASK.format(processors=1, patience_s=0.0), folder)
    assert said == f"False {LEAVES + sum(range(LEAVES)):.1f} 1"


@pytest.mark.parametrize("serving", [False, True])
def test_the_helper_begins_with_the_last_call(folder, serving):
    run(REVERSED.format(serving), folder)
    written = {file.stat().st_mtime_ns: file.name for file in folder.rglob("mine.leaf*.kernel")}
    order = [int(written[when].partition("-")[0].removeprefix("mine.leaf")) for when in sorted(written)]
    assert order == sorted(range(LEAVES), reverse=serving)


def test_processes_of_a_pool_start_none(monkeypatch):
    monkeypatch.setattr(second_process.multiprocessing, "parent_process", lambda: object())
    assert not second_process._is_wanted()
