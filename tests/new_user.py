"""The first hour of a new user, from nothing, in a temporary folder: `python -m tests.new_user`.

Installs the checkout in both orders, runs every example of README and site, the demo and a short training,
builds the site, and uninstalls: what an installed environment lacks shows. `--borrow` takes the dependencies
of this environment in place of downloading them. It ends at the first step that fails, with its output, and
exit code 1; the folder then stays.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from tests.code_blocks import blocks

ROOT = Path(__file__).parents[1]
_FIRST_STEP = """
import entropy_explore_env as eee
env = eee.parallel_env("box-7x11x5", robots=1)
env.reset(seed=0)
env.step({"robot_0": env.action_space("robot_0").sample()})
print(eee.__file__)
"""
_ONLY_IN_SOME = ("benchmarl", "ray", "torchrl")
"""Packages that examples name and that the installed extras do not bring; without them they are skipped."""


class StepError(Exception):
    """A step did not do what a user expects."""


@dataclasses.dataclass(frozen=True)
class User:
    """Somebody with a fresh environment and a clone.

    Attributes:
        home: The temporary folder.
        borrow: Whether dependencies are those of the environment that runs this.
    """

    home: Path
    borrow: bool

    @property
    def clone(self) -> Path:
        """The checkout."""
        return self.home / "clone"

    @property
    def environment(self) -> Path:
        """The virtual environment."""
        return self.home / "env"

    @property
    def python(self) -> Path:
        """Its interpreter."""
        return self.environment / ("Scripts" if os.name == "nt" else "bin") / "python"

    def variables(self) -> dict[str, str]:
        """Of the processes: nothing of this checkout's, and a cache for compiled kernels of their own."""
        kept = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        return {**kept, "XDG_CACHE_HOME": str(self.home / "cache"), "MPLBACKEND": "agg"}

    def call(self, words: Sequence[object], folder: Path | None = None) -> str:
        """Run a command; what it wrote.

        Raises:
            StepError: It ended with another exit code than 0.
        """
        ran = subprocess.run(
            list(map(str, words)),
            cwd=folder or self.home,
            env=self.variables(),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        if ran.returncode != 0:
            command = shlex.join(map(str, words))
            raise StepError(f"{command}\nexit code {ran.returncode}, not 0\n{ran.stdout[-6000:]}")
        return ran.stdout

    def run_module(self, command: str, folder: Path | None = None) -> str:
        """`python -m …` in the clone; what it wrote."""
        return self.call([self.python, "-m", *shlex.split(command)], folder or self.clone)

    def pip(self, command: str) -> None:
        """`pip …` in the environment, `.` being the clone; without downloads where dependencies are borrowed.

        Called outside the clone, since `python -c` looks for packages where it is called, as pip does not.
        """
        words = [re.sub(r"^\.(?=\[|$)", str(self.clone), word) for word in shlex.split(command)]
        if self.borrow and words[0] == "install":
            words[1:1] = ["--no-deps", "--no-build-isolation"]
        pip = f"import sys; from pip._internal.cli.main import main; sys.exit(main({words!r}))"
        self.call([self.python, "-c", pip])

    def first_step(self) -> Path:
        """Import and step, outside the clone; where the package lies."""
        return Path(self.call([self.python, "-c", _FIRST_STEP]).splitlines()[-1]).parent

    def can_import(self, module: str) -> bool:
        """Whether a module can be imported in the environment, whatever it needs in its turn."""
        try:
            self.call([self.python, "-c", f"import {module}"])
        except StepError:
            return False
        return True

    def check_gone(self) -> None:
        """Raise a StepError if the package can still be imported."""
        names = self.call([self.python, "-c", "import site; print(site.getsitepackages()[0])"])
        husk = Path(names.splitlines()[-1]) / "entropy_explore_env"
        if husk.exists():
            raise StepError(f"after pip uninstall {husk} is still there")


def _expect(holds: object, said: str) -> None:
    if not holds:
        raise StepError(said)


def environment(user: User) -> None:
    """A clone of what git knows of, and an empty virtual environment."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        check=True,
    )
    for name in filter(None, listed.stdout.decode().split("\0")):
        if (ROOT / name).is_file():
            (user.clone / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, user.clone / name)
    without = ["--without-pip"] if user.borrow else []
    user.call([sys.executable, "-m", "venv", *without, user.environment])
    if user.borrow:
        paths = user.call([user.python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"])
        (Path(paths.strip()) / "borrowed.pth").write_text(sysconfig.get_path("purelib") + "\n")


def install(user: User) -> None:
    """Both orders of installing, with an uninstall between them."""
    user.pip("install -q -e .")
    _expect(user.first_step() == user.clone / "entropy_explore_env", "an editable install is not the clone")
    user.pip("install -q .")
    _expect(user.first_step().is_relative_to(user.environment), "the second install is not what is imported")
    user.pip("uninstall -y -q entropy_explore_env")
    user.check_gone()
    user.pip("install -q .")
    _expect(user.first_step().is_relative_to(user.environment), "the install is not what is imported")
    if not user.borrow and sys.platform == "linux" and shutil.which("nvidia-smi") is None:
        user.pip("install -q torch --index-url https://download.pytorch.org/whl/cpu")
    user.pip("install -q -e '.[training,worlds,docs]'")
    _expect(user.first_step() == user.clone / "entropy_explore_env", "the first install shadows the second")


def examples(user: User) -> None:
    """Every code block of README and site."""
    for block in blocks():
        missing = [name for name in _imported_of_some(block.text) if not user.can_import(name)]
        if missing:
            print(f"    {block.name}: skipped, {missing[0]} is not installed here", file=sys.stderr)
            continue
        folder = user.home / "examples" / re.sub(r"\W", "-", block.name)
        folder.mkdir(parents=True)
        (folder / "example.py").write_text(block.text, encoding="utf-8")
        found_in = [str(user.clone), str((user.clone / block.name).parent)]  # a file imports its neighbours
        words = [user.python, "-c", f"import sys; sys.path[:0] = {found_in}; {_RUN_FILE}"]
        user.call(words, folder)


def _imported_of_some(text: str) -> list[str]:
    """The modules that an example imports from packages that the installed extras do not bring."""
    names = "|".join(_ONLY_IN_SOME)
    return re.findall(rf"^\s*(?:import|from) ((?:{names})\b[\w.]*)", text, re.MULTILINE)


_RUN_FILE = "import runpy; runpy.run_path('example.py', run_name='__main__')"


def demo(user: User) -> None:
    """`make demo`, or its command where there is no make; the robots drive."""
    out = user.clone / "results" / "demo"
    if shutil.which("make") is None:
        user.run_module("baselines.run office --strategy best --robots 3 --seed 0 --out results/demo")
    else:
        for name in ("pyproject.toml", "requirements/constraints.txt"):
            os.utime(user.clone / name, (0, 0))  # what the environment holds is installed
        (user.environment / "installed-baselines").touch()
        user.call(["make", "demo", f"VENV={user.environment}"], user.clone)
    missing = [name for name in ("json", "png", "gif", "npz") if not (out / f"mission.{name}").is_file()]
    _expect(not missing, f"make demo has not written {missing}")


def training(user: User) -> None:
    """A short training, and a test of its policy."""
    run = user.home / "runs" / "mine"
    words = "training.ppo --scenario office --robots 2 --missions 8 --total-steps 4000 --time-limit-s 120"
    user.run_module(f"{words} --validation-missions 2 --no-video --out {run}")
    test = "--time-limit-s 120 --seeds 2 --against random --jobs 1"
    user.run_module(f"training.evaluate --strategy {run} {test} --runs {user.home}/evaluated")


def site(user: User) -> None:
    """The documentation site, without a warning."""
    said = user.run_module("sphinx -b html -W --keep-going -q docs docs/build/html")
    _expect(not said and (user.clone / "docs/build/html/index.html").is_file(), f"sphinx says: {said}")


def uninstall(user: User) -> None:
    """Nothing is left that could be imported."""
    user.pip("uninstall -y -q entropy_explore_env")
    user.check_gone()


STEPS: tuple[Callable[[User], None], ...] = (
    environment,
    install,
    examples,
    demo,
    training,
    site,
    uninstall,
)


def main(words: Sequence[str] | None = None) -> int:
    """Run the steps."""
    names = [step.__name__ for step in STEPS]
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--borrow", action="store_true", help="dependencies of this environment; no downloads"
    )
    parser.add_argument(
        "--skip", default="", help=f"steps to leave out, commas between: {', '.join(names[2:])}"
    )
    args = parser.parse_args(words)
    skipped = set(filter(None, args.skip.split(",")))
    if not skipped <= set(names[2:]):
        parser.error(f"--skip: {args.skip}: names out of {', '.join(names[2:])}")
    user = User(Path(tempfile.mkdtemp(prefix="new-user-")), args.borrow)
    for step in STEPS:
        if step.__name__ in skipped:
            continue
        print(f"{step.__name__}: {(step.__doc__ or '').splitlines()[0]}", file=sys.stderr, flush=True)
        started = time.monotonic()
        try:
            step(user)
        except StepError as error:
            print(f"{step.__name__} failed: {error}\nthe folder stays: {user.home}", file=sys.stderr)
            return 1
        print(f"    done in {time.monotonic() - started:.0f} s", file=sys.stderr, flush=True)
    shutil.rmtree(user.home)
    print("all of it works")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
