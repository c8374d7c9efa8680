"""What seconds on the clock were measured on."""

from __future__ import annotations

from cpuinfo import get_cpu_info


def processor() -> str:
    """Return the processor's name, as the system tells it."""
    return get_cpu_info().get("brand_raw") or "unknown"
