"""Bad calls of everything public are answered by a named error, and change nothing."""

import pytest

from entropy_explore_env import EntropyExploreError
from tests.envs.bad_calls import Stage

CALLS = 5000


@pytest.fixture(scope="module")
def stage(tmp_path_factory) -> Stage:
    return Stage(tmp_path_factory.mktemp("bad"))


def check(stage: Stage, numbers: range) -> None:
    before = stage.digest()
    failures = []
    for number in numbers:
        name, call = stage.call(number)
        try:
            call()
            failures.append(f"{name}: accepted")
        except EntropyExploreError as error:
            if "\n" in str(error):
                failures.append(f"{name}: more than one line")
        except Exception as error:
            failures.append(f"{name}: {type(error).__name__}: {error}"[:300])
        if stage.digest() != before:
            failures.append(f"{name}: changed something")
            before = stage.digest()
    assert not failures, f"{len(failures)} of {len(numbers)}:\n" + "\n".join(failures)


def test_a_sample_of_bad_calls_is_refused_by_name_and_changes_nothing(stage: Stage) -> None:
    check(stage, range(400))


@pytest.mark.long
def test_bad_calls_are_refused_by_name_and_change_nothing(stage: Stage) -> None:
    check(stage, range(CALLS))


def test_every_target_can_be_called_with_something_wrong(stage: Stage) -> None:
    names = {stage.call(number)[0].split(": ", 1)[1].rsplit(",", 1)[0] for number in range(CALLS)}
    missed = {target.name for target in stage.targets} - names
    assert len(stage.targets) > 300 and not missed


def test_the_same_calls_with_nothing_wrong_are_taken(stage: Stage) -> None:
    """Else whatever they are given would be refused."""
    assert len(stage.makers) > 8
    for make in stage.makers.values():
        make()
        make(robots=1, split="test")
