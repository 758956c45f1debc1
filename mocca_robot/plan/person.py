"""Whoever stands beside the robot: asked where nothing can measure, or where a part would fall."""

from __future__ import annotations

from typing import Protocol

from mocca_robot.plan.gripper import Grip
from mocca_robot.plan.plan import MoveKind, Plan, Step


class Person(Protocol):
    """Somebody who answers, in their own time. Nothing here blocks: the arm stays supervised meanwhile."""

    def ask(self, question: str) -> None:
        """Put a question that yes or no answers."""
        ...

    def answer(self) -> bool | None:
        """Return the answer to the last question, None as long as there is none; False when nobody can answer."""
        ...

    def paused(self) -> bool:
        """Return whether the arm shall stand still for the moment."""
        ...


class Nobody:
    """Nobody is there: what needs a person ends the build."""

    def ask(self, question: str) -> None:
        """Ask in vain."""

    def answer(self) -> bool:
        """Return False."""
        return False

    def paused(self) -> bool:
        """Return False."""
        return False


class Everybody:
    """A simulation's person: supports and cradles are there when they are needed."""

    def ask(self, question: str) -> None:
        """Take it as asked."""

    def answer(self) -> bool:
        """Return True."""
        return True

    def paused(self) -> bool:
        """Return False."""
        return False


def before_release(plan: Plan, step: Step) -> str:
    """Return what to ask before a part is let go, '' when it stands by itself."""
    if step.part in plan.cradles:
        return f"{step.part} is about to be let go, and falls without its cradle. Does the cradle carry it?"
    if step.part in plan.supports:
        return f"{step.part} is about to be let go, and falls unless something holds it. Is it held?"
    return ""


def after_grip(step: Step, kind: MoveKind, grip: Grip) -> str:
    """Return what to ask after a grip that nothing has measured, '' after one that was."""
    if (grip.width_m, grip.vacuum, grip.held) != (None, None, None):
        return ""
    if kind is MoveKind.PICK:
        return f"This tool senses nothing. Is {step.part} firmly held by it?"
    return f"This tool senses nothing. Has it let go of {step.part}?"


def confirmations(plan: Plan, first_step: int = 0) -> tuple[str, ...]:
    """Return the parts, from a step on, that a person will be asked about."""
    cell = plan.cell
    blind = plan.gripper == "none" or (cell.vacuum is not None and cell.vacuum.input is None)
    blind = blind or (cell.fingers is not None and cell.fingers.held_input is None)
    return tuple(s.part for s in plan.steps[first_step:] if blind or before_release(plan, s))
