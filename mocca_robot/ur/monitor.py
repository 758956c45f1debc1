"""The eyes' side of the driver: a fresh, complete state of the arm, or the reason why there is none."""

from __future__ import annotations

import time
from collections.abc import Callable

from mocca_robot.plan.guards import STILL_RAD_S
from mocca_robot.plan.limits import MotionLimits
from mocca_robot.plan.status import ArmState, ExecutionStatus
from mocca_robot.plan.supervision import Stopped, parse_state, program_stop, safety_stop
from mocca_robot.ur.link import ChildLink, LinkLost

CYCLE_S = 0.02
CONNECT_S = 8.0
STILL_SAMPLES = 3
OBSERVE_S = 1.5
ABSENCE = 5.0
"""State older than this many times the limit is stale however little this process was allowed to run."""


class Monitor:
    """A supervised stream of states. `cancelled` is asked in every cycle for a reason to end.

    The age of a state counts the time in which this process ran: a computer that pauses all of its processes for a
    moment has not heard the robot fall silent. Meanwhile, and after `ABSENCE` in any case, the controller's watchdog
    decides, which such a pause does not stop.
    """

    def __init__(self, host: str, limits: MotionLimits, cancelled: Callable[[], str]) -> None:
        self.host = host
        self.limits = limits
        self.last: ArmState | None = None
        self._cancelled = cancelled
        self._eyes: ChildLink | None = None
        self._changed_at = 0.0
        self._polled_at = 0.0
        self._age = 0.0

    def open(self, deadline_s: float = CONNECT_S) -> None:
        """Connect; LinkLost when no state comes within the deadline."""
        self._eyes = ChildLink("eyes", self.host, deadline_s)
        self._changed_at = self._polled_at = time.monotonic()
        self._age = 0.0

    def close(self) -> None:
        """Disconnect."""
        if self._eyes is not None:
            self._eyes.kill()

    def watch(self) -> ArmState:
        """Return a fresh state in which our program runs; Stopped otherwise, or when the user has cancelled."""
        if reason := self._cancelled():
            raise Stopped(ExecutionStatus.CANCELLED, reason, self.last)
        state = self.poll()
        ended = program_stop(state)
        if ended is not None:
            raise Stopped(*ended, state)
        return state

    def poll(self) -> ArmState:
        """Return a fresh state with the safety system undisturbed; Stopped otherwise."""
        try:
            state = self._read(max(ABSENCE * self.limits.state_age_s, 0.2))
        except LinkLost as error:
            raise Stopped(ExecutionStatus.CONNECTION_LOST, f"no state: {error}", self.last) from error
        age = self.age_s
        if age > self.limits.state_age_s:
            detail = f"the controller's state is {1e3 * age:.0f} ms old, limit {1e3 * self.limits.state_age_s:.0f} ms"
            raise Stopped(ExecutionStatus.CONNECTION_LOST, detail, state)
        stopped = safety_stop(state)
        if stopped is not None:
            raise Stopped(*stopped, state)
        return state

    @property
    def age_s(self) -> float:
        """Return how old the last state is, in seconds."""
        absent = time.monotonic() - self._changed_at
        return absent if absent > ABSENCE * self.limits.state_age_s else self._age

    def settle(self, seconds: float) -> None:
        """Wait under supervision."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            time.sleep(CYCLE_S)
            self.watch()

    def stands_still(self) -> bool:
        """Return whether fresh states show the arm standing still, looked at through new eyes if the old ones fail."""
        if self.age_s <= self.limits.state_age_s and self._looks_still():
            return True
        if self._eyes is not None and self._eyes.alive and self.age_s <= self.limits.state_age_s:
            return False
        self.close()
        try:
            self.open(OBSERVE_S)
        except LinkLost:
            return False
        return self._looks_still()

    def _looks_still(self) -> bool:
        still, before = 0, self.last.time_s if self.last else -1.0
        end = time.monotonic() + OBSERVE_S
        while time.monotonic() < end and still < STILL_SAMPLES:
            try:
                state = self._read(0.5)
            except LinkLost:
                return False
            except Stopped:
                still = 0
            else:
                if state.time_s != before:
                    before = state.time_s
                    still = still + 1 if max(abs(v) for v in state.qd) < STILL_RAD_S else 0
            time.sleep(CYCLE_S / 2)
        return still >= STILL_SAMPLES

    def _read(self, deadline_s: float) -> ArmState:
        """Return what the eyes see now, and keep account of its age."""
        if self._eyes is None:
            raise LinkLost("the eyes are not open")
        state = parse_state(self._eyes.call("state", deadline_s=deadline_s))
        now = time.monotonic()
        if self.last is None or state.time_s != self.last.time_s:
            self._changed_at, self._age = now, 0.0
        else:
            self._age += min(now - self._polled_at, 2.0 * CYCLE_S)
        self._polled_at = now
        self.last = state
        return state
