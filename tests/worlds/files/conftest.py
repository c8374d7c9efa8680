"""Files of one test module are read by one process."""

import pytest

from entropy_explore_env.worlds.files.process import kept_reader


@pytest.fixture(scope="module", autouse=True)
def reader():
    with kept_reader() as kept:
        yield kept
