"""The supervised loop: paths, pushes, pauses and grips on any arm, each ending with a status and its evidence.

One cycle commands, waits, looks at the state and lets the guards judge it. What a robot may do to a motion ends it with
an Outcome, never with an exception; an exception that nobody foresaw stops the arm before it goes on.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.plan.arm import Arm
from mocca_robot.plan.gripper import Grip
from mocca_robot.plan.guards import (
    SEATING_PACE,
    Arrival,
    ForceGuard,
    ObeyGuard,
    PushGuard,
    check_path,
    check_start,
    needed_contact_n,
)
from mocca_robot.plan.person import Nobody, Person
from mocca_robot.plan.plan import Waypoint
from mocca_robot.plan.pose import Three, distance_m
from mocca_robot.plan.push_frame import frame_along
from mocca_robot.plan.status import ArmState, ExecutionStatus, MotionOutcome
from mocca_robot.plan.supervision import Stopped
from mocca_robot.tolerances import SAME_KG

LEAD_IN_S = 0.5
USUAL_CYCLE_S = 0.02
LONGEST_CYCLE_S = 0.1
HURRY = 1.2
"""How much longer than its fellows a cycle may count on the path's clock."""
AVERAGE_S, FEWEST = 0.4, 8
"""A bias is the mean of what the sensor shows in this time, of so many samples at least."""
PAUSE_S = 0.5
"""In which a path comes to a halt, and back to its speed."""
TRAIL = 50
"""Commands that the arm may lag behind."""


class Motions:
    """Supervised motions of `arm`. `speed` is the share of its planned speed at which a path is followed, and, below 1,
    a part pushed; above 1 only a simulated arm is asked to move. `person` is asked what nothing measures.
    """

    def __init__(self, arm: Arm, speed: float = 1.0, person: Person | None = None) -> None:
        self.arm = arm
        self.person = person or Nobody()
        self.limits = arm.limits
        self.speed = speed
        self._bias = np.zeros(6)

    def set_payload(self, mass_kg: float, cog_m: Three) -> MotionOutcome:
        """Set what the arm carries and read it back; REFUSED when the controller does not take it over."""

        def motion() -> MotionOutcome:
            self.arm.set_payload(mass_kg, cog_m)
            state = self._settle(0.1)
            if abs(state.payload_kg - mass_kg) > SAME_KG:
                detail = f"payload reads back as {state.payload_kg:.3f} kg after setting {mass_kg:.3f} kg"
                return MotionOutcome(ExecutionStatus.REFUSED, detail, state)
            return MotionOutcome(ExecutionStatus.SUCCEEDED, "", state)

        return self._supervised(motion)

    def zero_force(self) -> MotionOutcome:
        """Pause, zero the sensor, and take the mean of what it then shows as the bias.

        REFUSED when that is still large, or when its noise would pass for a contact.
        """

        def motion() -> MotionOutcome:
            self._settle(0.2)
            self.arm.zero_force()
            self._settle(0.1)
            state, seen = self._average(AVERAGE_S)
            self._bias, noise = seen.mean(axis=0), float(np.sqrt(seen[:, :3].var(axis=0, ddof=1).mean()))
            size, needed = float(np.linalg.norm(self._bias[:3])), needed_contact_n(noise)
            if needed > self.limits.contact_force_n:
                detail = (
                    f"the force sensor's noise is {noise:.1f} N (1σ), which a contact at "
                    f"{self.limits.contact_force_n:g} N could not be told from: look for what shakes the arm, or give "
                    f"the cell 'limits: {{contact_force_n: {math.ceil(needed)}, accepted: WHO, WHY}}' and plan again"
                )
                return MotionOutcome(ExecutionStatus.REFUSED, detail, state)
            if size > self.limits.contact_force_n:
                detail = (
                    f"the hand feels {size:.1f} N where it should hang free, limit {self.limits.contact_force_n:g} N"
                )
                return MotionOutcome(ExecutionStatus.REFUSED, detail, state)
            return MotionOutcome(ExecutionStatus.SUCCEEDED, "", state)

        return self._supervised(motion)

    def grip(self, width_m: float, force_n: float) -> tuple[MotionOutcome, Grip]:
        """Move the fingers, or switch the vacuum, while the arm stands still; return what they really did, too."""
        found = [Grip(None, None)]

        def motion() -> MotionOutcome:
            found[0] = self.arm.grip(width_m, force_n)
            return MotionOutcome(ExecutionStatus.SUCCEEDED, "", self.arm.watch())

        return self._supervised(motion), found[0]

    def confirm(self, question: str) -> MotionOutcome:
        """Ask the person beside the arm, while it stands under supervision; CANCELLED unless they say yes."""

        def motion() -> MotionOutcome:
            self.arm.show(question)
            self.person.ask(question)
            try:
                while True:
                    state = self.arm.attend()
                    answer = self.person.answer()
                    if answer is not None:
                        break
            finally:
                self.arm.show("")
            if not answer:
                raise Stopped(ExecutionStatus.CANCELLED, f"nobody confirmed: {question}", state)
            return MotionOutcome(ExecutionStatus.SUCCEEDED, question, state)

        return self._supervised(motion)

    def follow(self, path: Sequence[Waypoint], *, force_limit_n: float, contact_force_n: float | None) -> MotionOutcome:
        """Follow a timed path; CONTACT above `contact_force_n` (if any), FORCE_LIMIT above `force_limit_n`.

        The path's clock is the controller's, slowed down with it; the arm is led onto the path from where it stands.
        """
        reached = [0]

        def motion() -> MotionOutcome:
            state = self.arm.watch()
            check_start(state, path[0], self.limits)
            way = _Way(path, state, self._lead_in_s(state, path[0]), self.speed)
            arrival = Arrival()
            trail: deque[Array] = deque(maxlen=TRAIL)
            forces = ForceGuard(self._bias, self.limits, force_limit_n, contact_force_n)
            obeys = ObeyGuard()
            while True:
                reached[0] = way.advance(state, self.person.paused())
                trail.append(way.place)
                self.arm.servo(way.goal)
                state = self.arm.attend()
                forces.check(state)
                obeys.check(state, way.goal)
                check_path(state, trail, self.limits)
                if way.over and arrival.check(state, self.arm.now(), path[-1], self.limits):
                    break
            self.arm.end_servo()
            return MotionOutcome(ExecutionStatus.SUCCEEDED, "", self.arm.watch(), waypoint=len(path) - 1)

        outcome = self._supervised(motion)
        return outcome if outcome.succeeded else replace(outcome, waypoint=reached[0])

    def push(self, axis: Array, depth_m: float, *, force_limit_n: float) -> MotionOutcome:
        """Push compliantly along `axis` (3,), unit, until `depth_m` is measured; JAMMED when it does not get there."""
        limits = self.limits
        depth = [0.0]

        def motion() -> MotionOutcome:
            start = self.arm.watch()
            share = min(1.0, self.speed)
            forces = ForceGuard(self._bias, limits, force_limit_n)
            guard = PushGuard(start, axis, depth_m, forces, limits, speed=share)
            speed = share * limits.insert_speed_m_s
            frame, seating = frame_along(axis, start.tcp), False
            self.arm.push_along(frame, limits.push_force_n, speed)
            while True:
                state = self.arm.attend()
                there = guard.check(state)
                depth[0] = guard.depth_m
                if there:
                    break
                if guard.seating and not seating:
                    seating = True
                    self.arm.push_along(frame, limits.push_force_n, SEATING_PACE * speed)
            self.arm.end_push()
            state = self._settle(0.1)
            depth[0] = guard.measure(state)
            if depth[0] < depth_m - limits.depth_tolerance_m:
                raise Stopped(ExecutionStatus.JAMMED, "the part sprang back after the push", state)
            return MotionOutcome(ExecutionStatus.SUCCEEDED, f"depth {1e3 * depth[0]:.2f} mm", state, depth_m=depth[0])

        outcome = self._supervised(motion)
        if outcome.succeeded:
            return outcome
        detail = f"{outcome.detail} (depth {1e3 * depth[0]:.1f} of {1e3 * depth_m:.1f} mm)"
        return replace(outcome, detail=detail, depth_m=depth[0])

    def _supervised(self, motion: Callable[[], MotionOutcome]) -> MotionOutcome:
        try:
            return motion()
        except Stopped as stop:
            return self.arm.halt(stop)
        except BaseException:
            self.arm.stop()
            raise

    def _settle(self, seconds: float) -> ArmState:
        end = self.arm.now() + seconds
        while True:
            state = self.arm.attend()
            if self.arm.now() >= end:
                return state

    def _average(self, seconds: float) -> tuple[ArmState, Array]:
        """Return the last state and the wrenches (n, 6) that the sensor showed meanwhile, each once."""
        end, seen = self.arm.now() + seconds, {}
        while True:
            state = self.arm.attend()
            seen[state.time_s] = state.force
            if self.arm.now() >= end and len(seen) >= FEWEST:
                return state, np.array(list(seen.values()))

    def _lead_in_s(self, state: ArmState, first: Waypoint) -> float:
        """Return the time on the path's clock in which the arm is led onto the path from where it stands."""
        seconds = max(LEAD_IN_S, 2.0 * distance_m(state.tcp, first.tcp) / self.limits.approach_speed_m_s)
        return max(1.0, self.speed) * seconds


class _Way:
    """A path with its clock: `goal` (6,) is what to command now, `place` (3,) where the planned tool is."""

    def __init__(self, path: Sequence[Waypoint], state: ArmState, lead_in_s: float, speed: float) -> None:
        self._times = np.array([w.t - path[0].t for w in path])
        self._joints = np.array([w.q for w in path])
        self._places = np.array([w.tcp[:3] for w in path])
        self._offset = np.subtract(state.q, path[0].q)  # re-synced to where the arm really is, blended out
        self._lead_in_s = lead_in_s
        self._speed = speed
        self._clock, self._arm_time, self._pace = 0.0, state.time_s, USUAL_CYCLE_S
        self._going = 1.0
        self.last_s = max(float(self._times[-1]), lead_in_s)
        self.goal, self.place = self._joints[0], self._places[0]

    @property
    def over(self) -> bool:
        """Return whether the clock has reached the path's end."""
        return self._clock >= self.last_s

    def advance(self, state: ArmState, paused: bool = False) -> int:
        """Move the clock on to `state`, and return the last waypoint that was passed. Paused, it comes to a halt."""
        # A late cycle is not made up for: the path only takes longer, the arm never hurries after it.
        elapsed = max(state.time_s - self._arm_time, 0.0)
        self._pace += 0.1 * (min(elapsed, LONGEST_CYCLE_S) - self._pace)
        elapsed, self._arm_time = min(elapsed, HURRY * self._pace), state.time_s
        ramp, target = elapsed / PAUSE_S, 0.0 if paused else 1.0
        self._going = target if self._clock == 0.0 else self._going + min(max(target - self._going, -ramp), ramp)
        self._clock = min(self._clock + elapsed * state.speed_scaling * self._speed * self._going, self.last_s)
        fade = max(0.0, 1.0 - self._clock / self._lead_in_s)
        self.goal = _interpolate(self._times, self._joints, self._clock) + self._offset * (
            fade * fade * (3.0 - 2.0 * fade)
        )
        self.place = _interpolate(self._times, self._places, self._clock)
        return int(np.searchsorted(self._times, self._clock, side="right")) - 1


def _interpolate(times: Array, values: Array, t: float) -> Array:
    """Return values (k,) at time t of a piecewise linear path; its ends beyond them."""
    return np.array([float(np.interp(t, times, column)) for column in values.T])
