"""The files of public worlds on this machine: found in a folder of the user's, or fetched into the cache."""

from __future__ import annotations

import hashlib
import os
from functools import lru_cache
from pathlib import Path

import platformdirs

from entropy_explore_env.errors import SettingError, WorldError, did_you_mean, imported
from entropy_explore_env.worlds.public.table import PUBLIC, PublicWorld

FOLDER_VARIABLE = "ENTROPY_EXPLORE_WORLDS"
"""Variable of the environment with the folder of public worlds, in place of the user's cache."""
HOST = "https://raw.githubusercontent.com"
_TIMEOUT_S = 30.0


def public_folder() -> Path:
    """Return the folder in which files of public worlds are looked for, and into which they are fetched.

    Raises:
        SettingError: The system names no cache folder for the user.
    """
    named = os.environ.get(FOLDER_VARIABLE)
    if named:
        return Path(named).expanduser().absolute()
    found = Path(platformdirs.user_cache_dir("entropy_explore_env", appauthor=False)) / "worlds"
    if not found.is_absolute():
        raise SettingError(FOLDER_VARIABLE, None, "a folder: this system names no cache folder")
    return found


def public_file(name: str) -> Path:
    """Return the file of a public world that is read; its other files lie beside it.

    Files that are in the folder, or in any folder in it, and have the right content are taken as they are;
    others are fetched.

    Args:
        name: One of PUBLIC.

    Raises:
        WorldError: No world has this name, or its files are not here and cannot be fetched.
        MissingExtraError: They are not here, and the package that fetches them is not installed.
    """
    if name not in PUBLIC:
        raise WorldError("world", name, "the name of a public world" + did_you_mean(name, PUBLIC))
    world, folder = PUBLIC[name], public_folder()
    return found_file(world, folder) or _fetched(name, world, folder / world.source.name)


def found_file(world: PublicWorld, folder: Path) -> Path | None:
    """Return the first file of a world where a folder, or one in it, has all of them; None = none has.

    Only files with the right content count.
    """
    first, *_ = world.files
    own = folder / world.source.name / first
    if _is_whole(world, own):
        return own
    return next((file for file in sorted(folder.rglob(first)) if _is_whole(world, file)), None)


def _is_whole(world: PublicWorld, first: Path) -> bool:
    """Return whether a file, and those beside it, are the files of a world."""
    return all(_digest(first.with_name(name)) == known for name, known in world.files.items())


def _digest(file: Path) -> str | None:
    """Return the SHA-256 of a file; None where it cannot be read."""
    try:
        about = file.stat()
        return _digest_of(file, about.st_mtime_ns, about.st_size)
    except OSError:
        return None


@lru_cache(maxsize=256)
def _digest_of(file: Path, changed_ns: int, size: int) -> str:
    """Return the SHA-256 of a file, which is read again when it has changed."""
    del changed_ns, size  # part of the key of the cache
    return hashlib.sha256(file.read_bytes()).hexdigest()


def _fetched(name: str, world: PublicWorld, folder: Path) -> Path:
    """Fetch the files of a world into a folder, in which a file appears only with the right content."""
    pooch = imported("pooch", "pooch", "baselines")
    pooch.get_logger().setLevel("WARNING")
    for file, known in world.files.items():
        url = f"{HOST}/{world.source.folder}/{file}"
        try:
            downloader = pooch.HTTPDownloader(timeout=_TIMEOUT_S)
            pooch.retrieve(url, f"sha256:{known}", file, folder, downloader=downloader)
        except (OSError, ValueError) as error:
            names = " and ".join(world.files)
            allowed = (
                f"{names}, which could not be fetched: {_reason(error)} ({url}); put what is missing into a "
                f"folder, and set {FOLDER_VARIABLE} to it"
            )
            raise WorldError("world", name, allowed) from None
    return folder / next(iter(world.files))


def _reason(error: OSError | ValueError) -> str:
    """Return in a few words why a file could not be fetched."""
    from requests import exceptions

    if isinstance(error, exceptions.HTTPError) and error.response is not None:
        return f"the server answers {error.response.status_code}"
    if isinstance(error, exceptions.ChunkedEncodingError):
        return "the transfer broke off"
    if isinstance(error, exceptions.Timeout):
        return "the server does not answer"
    if isinstance(error, exceptions.RequestException):
        return "there is no connection"
    if isinstance(error, OSError):
        return f"{error.filename or 'the folder'}: {error.strerror or error}"
    return "what the server sent has another SHA-256 than the pinned file"
