"""Public worlds in tests, which fetch nothing: a test is skipped where the files that it needs are not."""

from __future__ import annotations

import pytest

from entropy_explore_env.worlds.public.fetching import FOLDER_VARIABLE, found_file, public_folder
from entropy_explore_env.worlds.public.table import PUBLIC


def needs_public_worlds(*names: str) -> None:
    """Skip the test that calls this, unless the files of these worlds are on this machine."""
    for name in names:
        if found_file(PUBLIC[name], public_folder()) is None:
            pytest.skip(f"the files of {name} are neither in the cache nor in {FOLDER_VARIABLE}")
