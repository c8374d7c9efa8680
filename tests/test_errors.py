"""Errors go to other processes, whatever the value is that they are about."""

from __future__ import annotations

import copy
import pickle

import pytest

from entropy_explore_env.errors import SettingError


class Unreadable:
    def __reduce__(self):
        return int, ("no number",)

    def __repr__(self):
        return "Unreadable()"


UNPICKLED = {
    "number": -1.0,
    "lambda": lambda: None,
    "unreadable": Unreadable(),
    "generator": [1, (i for i in ())],
}


@pytest.mark.parametrize("value", [-1.0, *UNPICKLED.values()], ids=["number", *UNPICKLED])
def test_an_error_about_what_cannot_be_pickled_goes_to_other_processes(value):
    error = SettingError("Robot.reach_m", value, "a number")
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is SettingError and str(again) == str(error)
    assert (again.field, again.allowed) == (error.field, error.allowed)
    assert repr(again.value) == repr(value)
    assert str(pickle.loads(pickle.dumps(again))) == str(error)
    assert copy.deepcopy(error).value is not None
