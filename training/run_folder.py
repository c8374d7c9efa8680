"""The folder of a training run: what the run was started with, so that its name is enough to continue it."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import shlex
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol, TypeVar

from baselines.cli.arguments import parse
from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings_json import dataclass_of, json_of
from entropy_explore_env.writing import write_atomically
from training.errors import CheckpointError

FILE = "run.json"
OF_THE_CALL = frozenset(("out", "resume"))
"""Options that say where a run is, and that are no settings of it."""
_INLINE = frozenset(("task", "world_file"))
"""Options in options whose own name is not typed."""


class RunOptions(Protocol):
    """Options of every trainer that has runs in folders; a dataclass."""

    out: Path | None
    resume: Path | None


Options = TypeVar("Options", bound=RunOptions)


def options_json(args: Any) -> dict[str, Any]:  # noqa: ANN401 - a dataclass of options
    """The options of a command as JSON holds them, without those that say where the run is."""
    fields = {each.name: getattr(args, each.name) for each in dataclasses.fields(args)}
    return {
        name: str(value) if isinstance(value, Path) else json_of(value)
        for name, value in fields.items()
        if name not in OF_THE_CALL
    }


def save_options(folder: Path, args: RunOptions, module: str, words: Sequence[str]) -> None:
    """Note in a run's folder what it is started with, and what its world files hold.

    Raises:
        SettingError: The folder cannot be written.
    """
    started = {
        "command": shlex.join(["python", "-m", module, *words]),
        "args": options_json(args),
        "files": {str(file): _digest(file) for file in _files_of(args)},
    }
    try:
        write_atomically(folder / FILE, json.dumps(started, indent=1, allow_nan=False) + "\n")
    except OSError as error:
        raise SettingError("out", str(folder), f"a folder that can be written ({error.strerror})") from None


def _files_of(args: RunOptions) -> list[Path]:
    """The world files that options name."""
    task = getattr(args, "task", None)
    named = (*(task.world if task is not None else ()), *getattr(args, "validation_world", ()))
    return [Path(file) for file in named if Path(file).is_file()]


def _digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


def _check_files(folder: Path, files: Mapping[str, str]) -> None:
    """Raise a CheckpointError where a world file of a run is not what it was."""
    for file, digest in files.items():
        there = Path(file).is_file()
        if not there or _digest(Path(file)) != digest:
            state = "changed since" if there else "missing"
            raise CheckpointError("world", file, f"the file that the run in {folder} began with ({state})")


def resumed_options(
    kind: type[Options],
    folder: Path,
    words: Sequence[str],
    changeable: frozenset[str],
    description: str | None = None,
    settle: Callable[[Options], Options] = lambda options: options,
) -> tuple[Options, dict[str, Any]]:
    """The options of a run that is continued: those that it was started with, and what may differ.

    Args:
        kind: The dataclass of options.
        folder: Of the run.
        words: Of the command line that continues it.
        changeable: Options that may differ.
        description: The first line of the help.
        settle: Makes options the same wherever they are read, as those that the run was started with.

    Returns:
        The options, and the values before of those that were changed.

    Raises:
        CheckpointError: There is no run in the folder, another option differs, or a world file has changed.
        SettingError: `--out` names another folder.
    """
    try:
        run = json.loads((folder / FILE).read_text("utf-8"))
        started, files = dataclass_of(kind, run["args"], FILE), dict(run["files"])
    except FileNotFoundError:
        raise CheckpointError("resume", str(folder), f"the folder of a run; it has no {FILE}") from None
    except (OSError, ValueError, LookupError, TypeError) as error:
        reason = f": {error}" if isinstance(error, SettingError) else ""
        allowed = f"the folder of a run, with a {FILE} of this version{reason}"
        raise CheckpointError("resume", str(folder), allowed) from None
    _check_files(folder, files)
    started.out = started.resume = folder
    args = parse(kind, words, default=started, description=description)
    if args.out is not None and args.out.absolute() != folder.absolute():
        raise SettingError("out", str(args.out), "not given with --resume, which names the folder")
    args = settle(args)
    args.out, changed = folder, {}
    was, now = _flat(options_json(started)), _flat(options_json(args))
    for name in was.keys() | now.keys():
        if was.get(name) != now.get(name):
            if name not in changeable:
                raise CheckpointError(name, now.get(name), f"{was.get(name)}, as in the run in {folder}")
            changed[name] = was.get(name)
    return args, changed


def _flat(options: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Options in options by their names on the command line, `channel.burst`."""
    flat: dict[str, Any] = {}
    for name, value in options.items():
        inside = prefix if name in _INLINE else f"{prefix}{name}."
        flat |= _flat(value, inside) if isinstance(value, dict) else {prefix + name: value}
    return flat


def resume_command(module: str, folder: Path) -> str:
    """What one types to continue a run."""
    return shlex.join(["python", "-m", module, "--resume", str(folder)])
