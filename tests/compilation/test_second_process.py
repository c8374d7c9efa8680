"""A second process compiles from the other end what the first one needs, and ends with it."""

import os
import time
from pathlib import Path

import pytest

import entropy_explore_env
from entropy_explore_env.compilation import second_process
from tests.compilation.test_kernels import run, start
from tests.systems import needs_posix

LEAVES = 24
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
SHARING = "from entropy_explore_env.compilation import dispatchers, second_process\n"
SHARING += "second_process.serves, second_process.shared = lambda: {serves}, lambda: True\n"
SHARING += "from mine import caller\n"
BUSY = """
claim = dispatchers.claim

def busy(path, *, waits):
    if not waits and path.name.startswith("mine.leaf3-"):
        raise dispatchers.ClaimedError
    return claim(path, waits=waits)

dispatchers.claim = busy
"""
COUNTED = """
infer, inferred = dispatchers.type_inference_stage, []

def counting(typing_context, target_context, function, *asked, **options):
    inferred.append(function.func_id.func_name)
    return infer(typing_context, target_context, function, *asked, **options)

dispatchers.type_inference_stage = counting
"""
OTHERS = CODE.replace("leaf", "other").replace("caller", "later")
ASKED = """
from numba import float64
from others import later

second_process._helper.waiting += [(caller, (float64,)), (later, (float64,))]
"""
WITHIN_NJIT = """
import numba

@numba.njit
def outer(x):
    return caller(x)

print(outer(1.0), caller(1.0))
"""
WITHOUT_STAMP = """
from typing import NamedTuple
from entropy_explore_env.compilation.kernels import lean_kernel

class Given(NamedTuple):
    x: float

@lean_kernel
def within(given):
    return caller(given.x)

@lean_kernel
def outer(x):
    return within(Given(x))

print(outer(1.0), caller(1.0))
"""
BETWEEN = """
import numba
from entropy_explore_env.compilation.kernels import lean_kernel
from mine import caller
from others import later

@numba.njit
def between(x):
    return caller(x)

@lean_kernel
def outer(x):
    return between(x) + later(x) - later(x)
"""
NOT_FOUND = """
from entropy_explore_env.compilation.kernels import lean_kernel

@lean_kernel
def of_the_script(x):
    return x

compile_ahead([(of_the_script, (1.0,)), (caller, (1,))])
until_s = time.monotonic() + 100.0
while len(list(Path("cache").rglob("mine.caller-*.kernel"))) < 2 and time.monotonic() < until_s:
    time.sleep(0.05)
print(len(list(Path("cache").rglob("mine.caller-*.kernel"))), flush=True)
"""
STARTED_AGAIN = f"""
second_process._helper.process.kill()
second_process._helper.process.wait()
{NOT_FOUND}
"""
KERNELS_ALONE = """
import sys
from types import ModuleType

package = sys.modules["entropy_explore_env"] = ModuleType("entropy_explore_env")
package.__path__ = [{path!r}]
from entropy_explore_env.missions.navigation import plan_missions
from entropy_explore_env.missions.observation.observe import observe_missions
from entropy_explore_env.missions.proposals import propose_missions, propose_to
from entropy_explore_env.missions.tick import step_missions

print(hasattr(package, "parallel_env"), step_missions.__name__)
"""
STOPPED = """
import os
import signal
import numpy as np
from numba import typeof

fields = [(f"field_{number}", float) for number in range(500)]
kinds = [(typeof(np.zeros(1, fields[:many])),) for many in range(1, 500)]
os.kill(second_process._helper.process.pid, signal.SIGSTOP)
second_process.send((caller, kind) for kind in kinds)
print(len(second_process._helper.asked) - 1, flush=True)
os.kill(second_process._helper.process.pid, signal.SIGKILL)
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "mine.py").write_text(CODE)
    return tmp_path


def leaves_in_order(folder):
    """The numbers of the leaves on disk, in the order in which they were written."""
    written = {file.stat().st_mtime_ns: file.name for file in folder.rglob("mine.leaf*.kernel")}
    return [int(written[when].partition("-")[0].removeprefix("mine.leaf")) for when in sorted(written)]


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
    run(SHARING.format(serves=serving) + "caller(1.0)", folder)
    assert leaves_in_order(folder) == sorted(range(LEAVES), reverse=serving)


@needs_posix
def test_what_another_process_compiles_is_left_for_later(folder):
    said = run(SHARING.format(serves=False) + BUSY + "print(caller(1.0))", folder)
    assert said == f"{LEAVES + sum(range(LEAVES)):.1f}"
    assert leaves_in_order(folder) == [*(number for number in range(LEAVES) if number != 3), 3]


def test_what_all_kernels_asked_for_call_comes_before_one_is_translated(folder):
    (folder / "others.py").write_text(OTHERS)
    said = run(SHARING.format(serves=False) + ASKED + "print(caller(1.0))", folder)
    assert said == f"{LEAVES + sum(range(LEAVES)):.1f}"
    assert len(list(folder.rglob("others.other*.kernel"))) == LEAVES
    assert not list(folder.rglob("others.later*.kernel"))
    caller = next(iter(folder.rglob("mine.caller*.kernel")))
    others = [file.stat().st_mtime_ns for file in folder.rglob("others.other*.kernel")]
    assert max(others) <= caller.stat().st_mtime_ns


def test_types_that_a_survey_has_inferred_are_not_inferred_again(folder):
    said = run(
        SHARING.format(serves=False) + COUNTED + "caller(1.0)\nprint(inferred.count('caller'))", folder
    )
    assert said == "2"  # which leaves it calls, and, now that they are compiled, its own types


@pytest.mark.parametrize(
    "code", [WITHIN_NJIT, WITHOUT_STAMP], ids=["in a function of Numba", "without a stamp"]
)
def test_within_an_inference_nothing_is_divided(folder, code):
    total = f"{LEAVES + sum(range(LEAVES)):.1f}"
    assert run(SHARING.format(serves=False) + code, folder) == f"{total} {total}"


def test_functions_of_numba_between_kernels_are_inferred_as_a_whole(folder):
    (folder / "others.py").write_text(OTHERS)
    (folder / "between.py").write_text(BETWEEN)
    said = run(SHARING.format(serves=False) + "from between import outer\nprint(outer(1.0))", folder)
    assert said == f"{LEAVES + sum(range(LEAVES)):.1f}"


@needs_posix
@pytest.mark.parametrize("code", [NOT_FOUND, STARTED_AGAIN], ids=["after one not found", "by another helper"])
def test_the_helper_compiles_what_it_is_asked_for_later(folder, code):
    said = run(ASK.format(processors=2, patience_s=100.0) + code, folder)
    assert said.splitlines()[-1] == "2"  # with a float, and with an integer


def test_kernels_of_missions_do_not_need_the_environments(folder):
    path = str(Path(entropy_explore_env.__file__).parent)
    assert run(KERNELS_ALONE.format(path=path), folder) == "False step_missions"


@needs_posix
def test_a_process_does_not_wait_until_its_helper_reads(folder):
    said = run(ASK.format(processors=2, patience_s=100.0) + STOPPED, folder)
    assert said.splitlines()[-1] == "499"


def test_processes_of_a_pool_start_none(monkeypatch):
    monkeypatch.setattr(second_process.multiprocessing, "parent_process", lambda: object())
    assert not second_process._is_wanted()
