"""Tasks on a Ray cluster of this machine: as in processes, and nothing is lost with a worker."""
# pyright: reportMissingImports=false

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import threading
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from baselines.cli.worker_options import WorkerOptions
from baselines.experiments import ray_cluster, ray_pool
from baselines.experiments.ray_cluster import RayCluster
from baselines.experiments.trials import Cell, How, run_cells
from baselines.experiments.worker_pool import Failure, run_each
from entropy_explore_env.errors import MissingExtraError, SettingError
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import BOX
from tests.systems import processes_with

ray = pytest.importorskip("ray", reason="ray is not installed: pip install 'entropy_explore_env[cluster]'")

pytestmark = [  # Ray's own
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
    pytest.mark.filterwarnings("ignore::FutureWarning"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
]
LOCAL = RayCluster("local")
MARK = f"RAY_POOL_TEST_{os.getpid()}"
"""In the environment of the workers that these tests may kill."""


@pytest.fixture(scope="module")
def two_workers():
    """A cluster of this machine with two processors, which all tests here share."""
    patched = pytest.MonkeyPatch()
    # Workers import the module of the tasks, this one.
    patched.setenv(MARK, "1")
    patched.setenv("PYTHONPATH", os.pathsep.join([str(Path(__file__).parent), *sys.path]))
    ray_cluster.start_here(ray_cluster.ray_of("cluster"), 2)
    yield
    ray.shutdown()
    patched.undo()


def work(task):
    """What a task's first word says, done by a worker."""
    match task:
        case "square", number:
            return number**2
        case "raise", _:
            raise SettingError("field", 3, "less")
        case "lambda", _:
            return lambda: None
        case "late", _:
            time.sleep(60.0)
        case "die once", trace:
            if not Path(trace).exists():
                Path(trace).touch()
                os._exit(7)
            return "alive"
        case "die", _:
            os._exit(7)
        case "sleep", seconds:
            began = time.time()
            time.sleep(seconds)
            return began, time.time()


def test_results_errors_limits_and_lost_workers(two_workers, tmp_path, monkeypatch, capfd):
    monkeypatch.setattr(ray_pool, "ATTEMPTS", 2)
    squares = [("square", number) for number in range(5)]
    unpicklable = ("square", threading.Lock())
    tasks = [*squares, ("raise", 0), ("lambda", 0), unpicklable, ("late", 0), ("die", 0)]
    once = ("die once", str(tmp_path / "died"))
    found: dict[Any, Any] = dict(run_each(work, [*tasks, once], LOCAL, 1.0))
    assert len(found) == len(tasks) + 1
    assert [found[task] for task in squares] == [0, 1, 4, 9, 16]
    assert found["raise", 0].reason == "SettingError: field = 3: expected less"
    assert isinstance(found["raise", 0].error, SettingError) and "in work" in found["raise", 0].trace
    assert "pickle" in found["lambda", 0].reason and "pickle" in found[unpicklable].reason
    assert found["late", 0] == Failure("ran past 1 s on the clock", late=True)
    assert found["die", 0].reason == "its worker was lost 2 times: WorkerCrashedError"
    assert found[once] == "alive"  # the second time
    assert capfd.readouterr().out == ""
    assert list(run_each(work, [], LOCAL)) == []


def test_at_most_so_many_tasks_at_a_time(two_workers):
    tasks = [("sleep", 0.1), ("sleep", 0.11), ("sleep", 0.12), ("sleep", 0.13)]
    spans = [span for _, span in run_each(work, tasks, RayCluster("local", at_once=1))]
    assert len(spans) == 4 and all(ends <= begins for (_, ends), (begins, _) in pairwise(sorted(spans)))


def test_a_caller_that_stops_asking_ends_what_runs(two_workers):
    results = run_each(work, [("square", 1), ("sleep", 60.0)], LOCAL)
    assert next(results) == (("square", 1), 1)
    started = time.monotonic()
    results.close()
    found = dict(run_each(work, [("square", 2), ("square", 3)], LOCAL))
    assert found == {("square", 2): 4, ("square", 3): 9}
    assert time.monotonic() - started < 55.0  # nobody waited for the sleep; new workers take a while


SHORT = with_settings(BOX, {"time_limit_s": 60.0})
CELLS = (Cell("walk", SHORT, "random", 24), Cell("steep", SHORT, "gradient", 16))


@pytest.mark.skipif(not Path("/proc/self/cmdline").exists(), reason="looks processes up in /proc")
def test_a_sweep_whose_workers_are_killed_leaves_the_same_bytes(two_workers, tmp_path, capsys):
    """As one of this machine does; progress is shown as always, and a resumed one runs what is missing."""
    done, kills, rng = threading.Event(), [], random.Random(0)

    def kill() -> None:
        while not done.wait(rng.uniform(0.05, 0.25)) and len(kills) < 6:
            if workers := processes_with(MARK, b"ray::trial"):
                kills.append(rng.choice(workers))
                os.kill(kills[-1], signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    try:
        rows = run_cells(CELLS, tmp_path / "cluster.jsonl", How(LOCAL, "the sweep", quiet=False))
    finally:
        done.set()
        killer.join()
    assert len(kills) >= 3, "missions were done before workers were killed"
    said = capsys.readouterr()
    assert "the sweep" in said.err and "40/40" in said.err and said.out == ""
    assert run_cells(CELLS, tmp_path / "here.jsonl", How(2)) == rows
    whole = (tmp_path / "here.jsonl").read_bytes()
    assert (tmp_path / "cluster.jsonl").read_bytes() == whole
    lines = whole.splitlines(keepends=True)
    (tmp_path / "cluster.jsonl").write_bytes(b"".join(lines[:7] + lines[9:]))
    assert run_cells(CELLS, tmp_path / "cluster.jsonl", How(LOCAL)) == rows
    assert (tmp_path / "cluster.jsonl").read_bytes() == whole


# --- options


def test_what_options_ask_for(monkeypatch):
    assert WorkerOptions(jobs=3).workers == 3
    assert WorkerOptions().workers == os.cpu_count()
    assert WorkerOptions(cluster="local").workers == RayCluster("local")
    assert WorkerOptions(jobs=4, cluster="10.0.0.1:6379").workers == RayCluster("10.0.0.1:6379", 4)
    for options, named in ((WorkerOptions(jobs=0), "jobs = 0"), (WorkerOptions(cluster="here"), "HOST:PORT")):
        with pytest.raises(SettingError, match=named):
            _ = options.workers
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"entropy_explore_env\[cluster\]"):
        _ = WorkerOptions(cluster="auto").workers


def test_an_address_where_no_cluster_answers_is_one_line(monkeypatch):
    if ray.is_initialized():
        ray.shutdown()
    monkeypatch.setattr(ray_cluster, "ANSWER_TIMEOUT_S", 3.0)
    with pytest.raises(SettingError) as said:
        list(run_each(work, [("square", 2)], RayCluster("127.0.0.1:9")))
    assert str(said.value) == "cluster = '127.0.0.1:9': expected the address of a Ray cluster that answers"


COMMAND = """
from baselines.experiments.ray_cluster import RayCluster
from baselines.experiments.trials import Cell, How, run_cells
from baselines.experiments.worker_pool import run_each

def double(number):
    return 2 * number

if __name__ == "__main__":
    print(sorted(run_each(double, [1, 2, 3], RayCluster("local", 1))))
"""


def test_a_command_s_own_functions_reach_workers(tmp_path):
    """As in `python -m training.experiment`, whose work is `__main__`'s."""
    (tmp_path / "command.py").write_text(COMMAND)
    words = [sys.executable, str(tmp_path / "command.py")]
    env = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])}
    ran = subprocess.run(words, env=env, capture_output=True, text=True, timeout=300)
    assert ran.stdout == "[(1, 2), (2, 4), (3, 6)]\n", ran.stderr
