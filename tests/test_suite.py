"""The suite itself: which tests are long, and which examples Hypothesis draws."""

from __future__ import annotations

from hypothesis import settings

from tests.reference.scenes import drawn


def test_the_suite_draws_the_same_examples_every_time_and_the_long_run_more():
    suite, long = settings.get_profile("suite"), settings.get_profile("long")
    assert suite.derandomize and suite.deadline is None
    assert not long.derandomize and long.max_examples > suite.max_examples
    inside = settings.default
    assert drawn(30).max_examples == 30 * inside.max_examples // suite.max_examples
    assert drawn(30).derandomize == inside.derandomize


def test_tests_are_called_the_same_in_every_process(request):
    """An address in a name would stop pytest-xdist: its processes would collect different tests."""
    assert [item.nodeid for item in request.session.items if " at 0x" in item.nodeid] == []
