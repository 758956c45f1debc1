"""Being run before other processes: an arm is watched on a clock of 100 ms, whatever else this computer does."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator

NICE = -15


def prefer_this_process() -> None:
    """Ask the scheduler to run this process, and those it starts, before all others that keep no deadlines.

    Niceness alone does not do: where sessions are scheduled as groups, as on most desktops, it counts within a session
    only. Without the right to real-time scheduling niceness is what is left, and without that to any nothing changes.
    """
    try:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(os.sched_get_priority_min(os.SCHED_RR)))
    except (OSError, AttributeError):  # no right to it, or no Linux
        with contextlib.suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, 0, NICE)


@contextlib.contextmanager
def preferred() -> Iterator[None]:
    """Have this process preferred for a while."""
    if not hasattr(os, "sched_getscheduler"):
        yield
        return
    policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    nice = os.getpriority(os.PRIO_PROCESS, 0)
    prefer_this_process()
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, policy, parameters)
            os.setpriority(os.PRIO_PROCESS, 0, nice)
