"""Of processes that need a kernel at once, one compiles it."""

from __future__ import annotations

import subprocess
import sys
import threading
import time

from entropy_explore_env.compilation import locks
from entropy_explore_env.compilation.locks import claim
from tests.systems import needs_posix

HOLD = "import sys; from pathlib import Path; from entropy_explore_env.compilation.locks import claim\n"
HOLD += "held = claim(Path(sys.argv[1])); print('held', flush=True); sys.stdin.read()"


@needs_posix
def test_the_second_waits_for_the_first(tmp_path):
    kernel, taken = tmp_path / "a.kernel", []
    first = claim(kernel)
    thread = threading.Thread(target=lambda: taken.append(claim(kernel)))
    thread.start()
    claim(tmp_path / "b.kernel").release()  # another kernel is free meanwhile
    time.sleep(0.1)
    assert not taken
    first.release()
    thread.join(timeout=30)
    assert len(taken) == 1
    taken[0].release()
    assert not list(tmp_path.iterdir())


@needs_posix
def test_a_process_that_dies_lets_go(tmp_path):
    kernel, pipe = tmp_path / "a.kernel", subprocess.PIPE
    process = subprocess.Popen([sys.executable, "-c", HOLD, str(kernel)], stdin=pipe, stdout=pipe)
    assert process.stdout is not None and process.stdout.readline() == b"held\n"
    process.kill()
    process.communicate()
    began_s = time.monotonic()
    claim(kernel).release()
    assert time.monotonic() - began_s < 10.0


def test_nobody_waits_for_ever_nor_where_there_are_no_locks(tmp_path, monkeypatch):
    kernel = tmp_path / "a.kernel"
    first = claim(kernel)
    monkeypatch.setattr(locks, "_PATIENCE_S", 0.05)
    claim(kernel).release()
    monkeypatch.setattr(locks, "_PATIENCE_S", 1e6)
    monkeypatch.setattr(locks, "fcntl", None)
    claim(kernel).release()
    first.release()


def test_a_folder_that_cannot_be_written_is_no_matter(tmp_path):
    (tmp_path / "file").write_text("")
    claim(tmp_path / "file" / "a.kernel").release()
