"""Safety caps: what the driver never exceeds, whatever a plan asks. Configuration may only lower them.

The figures are published starting points for assembly with e-series arms; they are unproven on hardware here. A cell's
own risk assessment (ISO 10218-2, ISO/TS 15066) decides what is safe, and may only tighten them, with two exceptions:
the force that counts as contact follows the arm's sensor, and a lab may raise it if it says who accepts that, and why;
and `preset` chooses how fast the arm moves: `reduced` unless said otherwise, `collaborative`, or `fenced`, which nobody
gets without saying who accepts it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from types import MappingProxyType

from mocca_robot.errors import InputError, nearest


@dataclass(frozen=True, kw_only=True)
class MotionLimits:
    """Caps of one cell. SI units; a plan or configuration can lower each, never raise it above those of its preset."""

    preset: str = "reduced"
    """Which of `PRESETS` the caps are those of."""
    transfer_speed_m_s: float = 0.10
    transfer_acceleration_m_s2: float = 0.5
    lift_speed_m_s: float = 0.05
    retreat_speed_m_s: float = 0.05
    approach_speed_m_s: float = 0.02
    insert_speed_m_s: float = 0.01
    insert_acceleration_m_s2: float = 0.1
    joint_speed_rad_s: float = math.radians(60)
    """PolyScope's own default for joint moves."""
    joint_acceleration_rad_s2: float = math.radians(80)
    """PolyScope's own default for joint moves."""
    joint_step_rad: float = 0.2
    """Largest change of one joint between two waypoints, and from the measured to a first commanded pose."""
    contact_force_n: float = 5.0
    """Over the zeroed bias: a guarded motion that feels more has touched something."""
    push_force_n: float = 10.0
    jam_force_n: float = 15.0
    jam_speed_m_s: float = 0.002
    jam_time_s: float = 0.25
    abort_force_n: float = 25.0
    abort_torque_nm: float = 2.0
    abort_tilt_rad: float = math.radians(5)
    force_damping: float = 0.1
    force_gain: float = 0.5
    retries: int = 2
    search_tries: int = 0
    """How often a part that meets something at its mouth is pushed again a little beside it, before a retry."""
    state_age_s: float = 0.1
    """State older than this is no state: stop."""
    start_joint_rad: float = 0.01
    start_distance_m: float = 0.002
    """How close the arm must stand to the first waypoint of a motion."""
    tracking_distance_m: float = 0.02
    """Farther than this from the commanded path: stop."""
    depth_tolerance_m: float = 0.001
    """An insertion counts as complete when its measured depth lacks no more than this."""
    sideways_tolerance_m: float = 0.001
    """And its hand is no farther beside the planned place than this,"""
    tilt_tolerance_rad: float = math.radians(1)
    """nor tilted by more than this."""
    grip_tolerance_m: float = 0.002
    """Fingers that close to a width farther than this from the part's do not hold the part."""
    watchdog_hz: float = 5.0
    """The controller stops the program when it hears nothing for one period: the link or this process died."""
    accepted: str = ""
    """Who accepts that a cap in `RAISABLE` is higher than the driver's, and why; nothing is raised without it."""

    def lowered(
        self, values: Mapping[str, object], where: str = "", contact_cap_n: float | None = None
    ) -> MotionLimits:
        """Return these limits with some lowered; InputError for an unknown name, a non-number or a raise, which
        names the file or section `where` the values stand. `contact_cap_n` is what the arm's own sensor asks for.
        """
        place = f"{where}: limit" if where else "Limit"
        known = {f.name for f in fields(self)}
        accepted = values.get("accepted", "")
        if not isinstance(accepted, str) or ("accepted" in values and not accepted.strip()):
            raise InputError(
                f"{where or 'Limits'}: 'accepted' is {accepted!r}; write who accepts what is raised, and why."
            )
        preset = _preset(values, self.preset, accepted, where or "Limits")
        changes: dict[str, float | int | str] = {"accepted": accepted} if accepted else {}
        if "preset" in values:
            changes |= {"preset": preset, **SPEEDS[preset]}
        for name, value in values.items():
            if name not in known:
                raise InputError(f"{place} '{name}' is unknown; {nearest(name, known)}")
            if name not in WORDS:
                changes[name] = _checked(name, value, where, _cap(name, preset, accepted, contact_cap_n))
        return replace(self, **changes)  # type: ignore[arg-type]

    def changed(self) -> dict[str, float | str]:
        """Return the limits that differ from the defaults: what a plan file has to record."""
        default = asdict(MotionLimits())
        return {name: value for name, value in asdict(self).items() if value != default[name]}


def _preset(values: Mapping[str, object], before: str, accepted: str, where: str) -> str:
    """Return the preset that `values` ask for; InputError for an unknown one, or one that nobody accepted."""
    preset = values.get("preset", before)
    if not isinstance(preset, str) or preset not in SPEEDS:
        raise InputError(f"{where}: preset is {preset!r}; {nearest(str(preset), SPEEDS)}")
    if preset in NEEDS_ACCEPTANCE and not accepted:
        fast = SPEEDS[preset]["transfer_speed_m_s"]
        raise InputError(
            f"{where}: preset '{preset}' moves the arm at up to {fast:g} m/s, which is for a cell that nobody can "
            "enter while it moves. Add 'accepted: WHO, WHY' beside it, or take 'collaborative'."
        )
    return preset


def _cap(name: str, preset: str, accepted: str, contact_cap_n: float | None) -> float:
    """Return the largest value of a limit: the driver's, the arm's, or what somebody may accept."""
    if accepted and name in RAISABLE:
        return RAISABLE[name]
    cap = SPEEDS[preset].get(name, float(getattr(HARD_CAPS, name)))
    return max(cap, contact_cap_n) if name == "contact_force_n" and contact_cap_n is not None else cap


def _checked(name: str, value: object, where: str, cap: float) -> float | int:
    place = f"{where}: limit" if where else "Limit"
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise InputError(f"{place} '{name}' is {value!r}; give a finite number of at most {cap:g}.")
    floor, ceiling = bounds(name)
    if ceiling is None:
        if value < cap:
            raise InputError(f"{place} '{name}' is {value:g}; below {cap:g} would be less safe, give at least that.")
    elif not floor <= value <= cap:
        higher = RAISABLE.get(name, 0.0)
        remedy = (
            f"only lower, unless somebody accepts up to {higher:g}: add 'accepted: WHO, WHY' beside it"
            if value > cap and higher > cap
            else "only lower"
        )
        raise InputError(
            f"{place} '{name}' is {value:g}; it must lie between {floor:g} and the driver's cap {cap:g}, which "
            f"configuration may {remedy}."
        )
    return int(value) if name in COUNTS else float(value)


HARD_CAPS = replace(MotionLimits(), abort_force_n=40.0, search_tries=16)
"""No configuration exceeds these, except for the speeds of its preset; only the abort force (25 N) and searching (off)
have room above their defaults."""
COUNTS = frozenset({"retries", "search_tries"})
_MOVING = (
    "transfer_speed_m_s",
    "transfer_acceleration_m_s2",
    "lift_speed_m_s",
    "retreat_speed_m_s",
    "joint_speed_rad_s",
    "joint_acceleration_rad_s2",
)
SPEEDS: Mapping[str, Mapping[str, float]] = MappingProxyType(
    {
        "reduced": MappingProxyType({name: float(getattr(HARD_CAPS, name)) for name in _MOVING}),
        "collaborative": MappingProxyType(
            dict(zip(_MOVING, (0.5, 1.0, 0.25, 0.25, math.radians(60), math.radians(80)), strict=True))
        ),
        "fenced": MappingProxyType(
            dict(zip(_MOVING, (1.0, 2.0, 0.5, 0.5, math.radians(120), math.radians(160)), strict=True))
        ),
    }
)
"""The caps of free motion by preset. What touches parts, approach, pick and insertion, is the same in all: it is about
the structure. 0.25 m/s is the reduced speed of ISO 10218-1, with which people teach robots; 0.5 m/s is a starting point
for a risk assessment after ISO/TS 15066, whose limits depend on what the arm carries and whom it could meet where."""
NEEDS_ACCEPTANCE = frozenset({"fenced"})

RAISABLE = MappingProxyType({"contact_force_n": 20.0})
"""What a lab may raise above the driver's caps, and how far, when it says who accepts that: a sensor that is noisier
than others sees contacts where there are none."""
WORDS = frozenset({"preset", "accepted"})
NUMBERS = tuple(f.name for f in fields(MotionLimits) if f.name not in WORDS)
RAISE_IS_SAFER = frozenset({"watchdog_hz"})

_FLOORS = MappingProxyType(
    {
        "transfer_speed_m_s": 1e-3,
        "transfer_acceleration_m_s2": 1e-2,
        "lift_speed_m_s": 1e-3,
        "retreat_speed_m_s": 1e-3,
        "approach_speed_m_s": 1e-3,
        "insert_speed_m_s": 1e-3,
        "insert_acceleration_m_s2": 1e-2,
        "joint_speed_rad_s": 1e-2,
        "joint_acceleration_rad_s2": 1e-2,
        "joint_step_rad": 1e-3,
        "contact_force_n": 1.0,
        "push_force_n": 1.0,
        "abort_force_n": 5.0,
        "state_age_s": 0.02,
        "start_joint_rad": 1e-4,
        "start_distance_m": 1e-4,
        "tracking_distance_m": 2e-3,
        "depth_tolerance_m": 1e-4,
        "sideways_tolerance_m": 1e-4,
        "tilt_tolerance_rad": 1e-3,
        "grip_tolerance_m": 2e-4,
    }
)
"""Below these a figure is a typing mistake (or stops every motion): refused rather than obeyed."""


def bounds(name: str) -> tuple[float, float | None]:
    """Return the smallest and the largest value that configuration may give one limit in any preset; None = as large as
    it likes.
    """
    cap = max(float(getattr(HARD_CAPS, name)), *(s.get(name, 0.0) for s in SPEEDS.values()))
    return (cap, None) if name in RAISE_IS_SAFER else (_FLOORS.get(name, 0.0), cap)
