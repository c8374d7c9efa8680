"""Install, run, uninstall, install from the checkout, run: in an environment of its own."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
RUN = (
    "import entropy_explore_env as eee\n"
    "env = eee.parallel_env('box-7x11x5', robots=1)\n"
    "env.reset(seed=0)\n"
    "env.step({'robot_0': env.action_space('robot_0').sample()})\n"
    "print(eee.__file__)\n"
)


@pytest.mark.long
def test_install_run_uninstall_and_install_from_the_checkout(tmp_path):
    """What a first installation leaves behind must not shadow the second one, nor stay importable."""
    home, elsewhere = tmp_path / "env", tmp_path / "elsewhere"
    elsewhere.mkdir()
    copy = tmp_path / "checkout"
    copy.mkdir()
    shutil.copytree(ROOT / "entropy_explore_env", copy / "entropy_explore_env")
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, copy)
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(home)], check=True)
    python = home / ("Scripts" if os.name == "nt" else "bin") / "python"
    paths = subprocess.run(
        [python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"],
        capture_output=True,
        text=True,
        check=True,
    )
    site = Path(paths.stdout.strip())
    # pip, setuptools and the dependencies are those of this environment; nothing is downloaded.
    (site / "borrowed.pth").write_text(sysconfig.get_path("purelib") + "\n")
    surroundings = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    surroundings["XDG_CACHE_HOME"] = str(tmp_path / "cache")

    def call(*words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [str(python), *words], cwd=elsewhere, env=surroundings, capture_output=True, text=True
        )

    def install(*words: str) -> None:
        pip = f"import sys; from pip._internal.cli.main import main; sys.exit(main({list(words)!r}))"
        ran = call("-c", pip)
        assert ran.returncode == 0, ran.stderr

    options = ("--no-deps", "--no-build-isolation", "--ignore-installed", "-q")
    install("install", *options, str(copy))
    first = call("-c", RUN)
    assert first.returncode == 0, first.stderr
    assert Path(first.stdout.splitlines()[-1]).parent == site / "entropy_explore_env"
    install("uninstall", "-y", "-q", "entropy_explore_env")
    assert not (site / "entropy_explore_env").exists()
    gone = call("-S", "-c", f"import sys; sys.path.insert(0, {str(site)!r}); import entropy_explore_env")
    assert gone.returncode != 0 and "ModuleNotFoundError" in gone.stderr
    install("install", *options, "-e", str(copy))
    second = call("-c", RUN)
    assert second.returncode == 0, second.stderr
    assert Path(second.stdout.splitlines()[-1]).parent == copy / "entropy_explore_env"
