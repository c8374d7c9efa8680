"""Threads that share missions: errors pass on, a closed pool begins anew, and a forked child has its own."""

import os
import subprocess
import sys

import pytest

from entropy_explore_env.missions.threads import Threads
from tests.systems import needs_posix

FORKED = """
import os, signal
import numpy as np
import entropy_explore_env as library
env = library.EntropyExploreVectorEnv("box-7x11x5", 4, threads=2)
env.reset(seed=0)
env.action_space.seed(0)
actions = [env.action_space.sample() for _ in range(3)]
env.step(actions[0])
reading, writing = os.pipe()
child = os.fork()
after = env.step(actions[1])[0], env.step(actions[2])[1]
seen = b"".join(np.ascontiguousarray(part).tobytes() for part in (*after[0].values(), after[1]))
if child == 0:
    os.write(writing, seen[:60000])
    os._exit(0)
os.close(writing)
told = b""
while chunk := os.read(reading, 65536):
    told += chunk
assert os.waitpid(child, 0)[1] == 0
assert told == seen[:60000] and len(told) > 1000
print("the same")
"""


@needs_posix
def test_a_forked_child_steps_on_as_its_parent_does():
    """In a process of its own, which can be ended if the child hangs."""
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", FORKED],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.stdout == "the same\n", done.stderr


def test_every_thread_works_and_the_first_error_is_raised():
    threads, called = Threads(3), []
    threads.run(called.append)
    assert sorted(called) == [0, 1, 2]

    def fail(number):
        if number > 0:
            raise KeyError(number)

    with pytest.raises(KeyError, match="1"):
        threads.run(fail)
    threads.close()
    threads.close()
    threads.run(called.append)
    assert sorted(called) == [0, 0, 1, 1, 2, 2]
    threads.forget()
    threads.run(called.append)
    assert len(called) == 9
