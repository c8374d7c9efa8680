"""How Hypothesis draws examples, and how conformance is checked fast.

Examples are the same in every run of the suite, others and more in `make test-long`, which chooses the
second profile with `--hypothesis-profile=long`.
"""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, settings

from entropy_explore_env.envs import conformance

SLOW_MACHINES = {
    "deadline": None,
    "suppress_health_check": [HealthCheck.too_slow, HealthCheck.filter_too_much],
}
settings.register_profile("suite", derandomize=True, max_examples=100, **SLOW_MACHINES)
settings.register_profile("long", derandomize=False, max_examples=1000, **SLOW_MACHINES)
settings.load_profile("suite")


@pytest.fixture
def in_this_process(monkeypatch: pytest.MonkeyPatch) -> int:
    """Conformance without fresh processes, which take most of its time: how many checks are left."""
    checks = [check for check in conformance.CHECKS if check is not conformance.check_processes]
    monkeypatch.setattr(conformance, "CHECKS", checks)
    return len(checks)
