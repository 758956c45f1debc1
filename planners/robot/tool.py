"""What the arm holds parts with: a parallel gripper or a suction cup, its shape and what it can hold."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mocca_robot.assembly import Array, read_only
from mocca_robot.errors import InputError
from mocca_robot.files import fields
from mocca_robot.ur.plan_reader import GRIPPERS
from mocca_robot.ur.pose import Six, six, three
from mocca_robot.ur.wiring import DEFAULT_WAIT_S, SIGNALS, WAIT_S, VacuumWiring

GRAVITY = 9.81
SAFETY = 2.0
"""A tool holds this many times a part's weight: what the arm's own acceleration (0.5 m/s²) and doubt ask for."""


@dataclass(frozen=True, eq=False)
class ParallelGripper:
    """A parallel gripper that closes along y of the flange's frame.

    Attributes:
        tcp_offset: the point between the pads, flange frame.
        stroke_m: smallest and largest opening.
        palm_m: (2, 3) corners of the box around the hand, flange frame.
        finger_m: (2, 3) corners of the box around one finger, pads left out, when closed; the other mirrors it in y.
        pad_radius_m: of the pads, which touch each other when closed; a part must cover them.
        opening_m: how much wider than the part the fingers open before and after the grasp.
        force_n: with which the fingers close.
        friction: between pads and part.
    """

    name: str
    tcp_offset: Six
    mass_kg: float
    cog_m: tuple[float, float, float]
    stroke_m: tuple[float, float]
    palm_m: Array
    finger_m: Array
    pad_radius_m: float
    opening_m: float
    force_n: float
    friction: float

    def too_heavy(self, mass_kg: float) -> str:
        """Return '' or why a part of this mass would slip out of the fingers."""
        holds = 2.0 * self.friction * self.force_n / (SAFETY * GRAVITY)
        return "" if mass_kg <= holds else f"heavier than the fingers hold ({mass_kg:.2f} kg, at most {holds:.2f} kg)"


@dataclass(frozen=True, eq=False)
class SuctionGripper:
    """One bellows cup at the end of a stem along z of the flange's frame. Opening 0 is vacuum, `RELEASED_M` none.

    Attributes:
        tcp_offset: the middle of the cup's lip on the part, flange frame.
        palm_m: (2, 3) corners of the box around valve and flange, flange frame.
        stem_radius_m: of the stem between that box and the cup.
        cup_radius_m: of the lip: the part must be even there.
        bellows_m: how uneven the part may be under the lip.
        vacuum_pa: below the air's pressure.
        friction: between lip and part.
        wiring: of valve and vacuum switch; None: planned and rehearsed, but not executed.
    """

    name: str
    tcp_offset: Six
    mass_kg: float
    cog_m: tuple[float, float, float]
    palm_m: Array
    stem_radius_m: float
    cup_radius_m: float
    bellows_m: float
    vacuum_pa: float
    friction: float
    wiring: VacuumWiring | None = None

    RELEASED_M = 0.01
    opening_m = RELEASED_M
    stroke_m = (0.0, RELEASED_M)

    @property
    def force_n(self) -> float:
        """Return what the vacuum pulls with."""
        return float(self.vacuum_pa * np.pi * self.cup_radius_m**2)

    @property
    def stiffness_n_m(self) -> float:
        """Return how stiffly the cup holds a part: pulled with all of its vacuum, it gives by its bellows' travel."""
        return self.force_n / self.bellows_m

    @property
    def stiffness_nm_rad(self) -> float:
        """Return how stiffly the cup keeps a part from turning: its stiffness lies around its lip."""
        return 0.5 * self.stiffness_n_m * self.cup_radius_m**2

    def too_heavy(self, mass_kg: float) -> str:
        """Return '' or why a part of this mass would slip off: carried sideways, friction alone holds it."""
        holds = self.friction * self.force_n / (SAFETY * GRAVITY)
        return "" if mass_kg <= holds else f"heavier than the cup holds ({mass_kg:.2f} kg, at most {holds:.2f} kg)"

    def tips(self, mass_kg: float, lever_m: float) -> str:
        """Return '' or why a part whose middle is `lever_m` from the middle of the lip would tip off the cup."""
        holds = self.force_n * self.cup_radius_m / SAFETY
        moment = GRAVITY * mass_kg * lever_m
        return "" if moment <= holds else "its weight would tip it off the cup"


Gripper = ParallelGripper | SuctionGripper

_SHARED = ("kind", "name", "tcp_offset_m", "mass_kg", "cog_m", "palm_m", "friction")
_WIRING = ("vacuum_output", "vacuum_input", "vacuum_wait_s")
_KEYS = {
    "parallel": (*_SHARED, "stroke_m", "finger_m", "pad_radius_m", "opening_m", "force_n"),
    "suction": (*_SHARED, "stem_radius_m", "cup_radius_m", "bellows_m", "vacuum_kpa", *_WIRING),
}


def read_gripper(value: Any, where: str) -> Gripper:
    """Return the gripper of a cell file; InputError names the key, its value and what it has to be."""
    kind = "parallel"
    if isinstance(value, dict) and "kind" in value:
        kind = fields.choice(value["kind"], tuple(_KEYS), f"{where}.kind")
    raw = fields.mapping(value, where, _KEYS[kind])
    offset = fields.vector(needed(raw, "tcp_offset_m", where), f"{where}.tcp_offset_m", (3,))
    tcp = six([*offset, 0.0, 0.0, 0.0])
    mass = fields.number(needed(raw, "mass_kg", where), f"{where}.mass_kg", 0.0, 30.0)
    cog = three(fields.vector(raw.get("cog_m", [0, 0, 0]), f"{where}.cog_m", (3,)))
    palm = box(needed(raw, "palm_m", where), f"{where}.palm_m", 3)
    friction = fields.number(raw.get("friction", 0.5), f"{where}.friction", 0.01, 2.0)
    if kind == "suction":
        return SuctionGripper(
            name=fields.choice(raw.get("name", "suction"), ("suction",), f"{where}.name"),
            tcp_offset=tcp,
            mass_kg=mass,
            cog_m=cog,
            palm_m=palm,
            stem_radius_m=fields.number(needed(raw, "stem_radius_m", where), f"{where}.stem_radius_m", 0.001, 0.1),
            cup_radius_m=fields.number(needed(raw, "cup_radius_m", where), f"{where}.cup_radius_m", 0.001, 0.1),
            bellows_m=fields.number(raw.get("bellows_m", 0.0015), f"{where}.bellows_m", 1e-4, 0.02),
            vacuum_pa=1e3 * fields.number(raw.get("vacuum_kpa", 60.0), f"{where}.vacuum_kpa", 1.0, 100.0),
            friction=friction,
            wiring=_wiring(raw, where),
        )
    stroke = fields.vector(needed(raw, "stroke_m", where), f"{where}.stroke_m", (2,))
    if not 0.0 <= stroke[0] < stroke[1]:
        raise InputError(f"{where}.stroke_m is {stroke.tolist()}; give the smallest opening, then the largest.")
    return ParallelGripper(
        name=fields.choice(raw.get("name", "2f85"), [g for g in GRIPPERS if g != "suction"], f"{where}.name"),
        tcp_offset=tcp,
        mass_kg=mass,
        cog_m=cog,
        stroke_m=(float(stroke[0]), float(stroke[1])),
        palm_m=palm,
        finger_m=box(needed(raw, "finger_m", where), f"{where}.finger_m", 3),
        pad_radius_m=fields.number(raw.get("pad_radius_m", 0.006), f"{where}.pad_radius_m", 0.0, 0.1),
        opening_m=fields.number(raw.get("opening_m", 0.012), f"{where}.opening_m", 0.002, 0.1),
        force_n=fields.number(raw.get("force_n", 20.0), f"{where}.force_n", 1.0, 235.0),
        friction=friction,
    )


def _wiring(raw: dict[str, Any], where: str) -> VacuumWiring | None:
    if raw.get("vacuum_output") is None:
        for key in _WIRING[1:]:
            if raw.get(key) is not None:
                raise InputError(f"{where}.{key} is given, but not 'vacuum_output': name the output of the valve, too.")
        return None
    switch = raw.get("vacuum_input")
    return VacuumWiring(
        fields.choice(raw["vacuum_output"], SIGNALS, f"{where}.vacuum_output"),
        None if switch is None else fields.choice(switch, SIGNALS, f"{where}.vacuum_input"),
        fields.number(raw.get("vacuum_wait_s", DEFAULT_WAIT_S), f"{where}.vacuum_wait_s", *WAIT_S),
    )


def gripper_document(gripper: Gripper) -> dict[str, Any]:
    """Return the gripper as a plan records it, with the keys of the cell file: whoever rehearses it needs its shape."""
    shared = {
        "name": gripper.name,
        "tcp_offset_m": list(gripper.tcp_offset[:3]),
        "mass_kg": gripper.mass_kg,
        "cog_m": list(gripper.cog_m),
        "palm_m": gripper.palm_m.tolist(),
        "friction": gripper.friction,
    }
    if isinstance(gripper, SuctionGripper):
        return {
            "kind": "suction",
            **shared,
            "stem_radius_m": gripper.stem_radius_m,
            "cup_radius_m": gripper.cup_radius_m,
            "bellows_m": gripper.bellows_m,
            "vacuum_kpa": 1e-3 * gripper.vacuum_pa,
            **_wiring_document(gripper.wiring),
        }
    return {
        "kind": "parallel",
        **shared,
        "stroke_m": list(gripper.stroke_m),
        "finger_m": gripper.finger_m.tolist(),
        "pad_radius_m": gripper.pad_radius_m,
        "opening_m": gripper.opening_m,
        "force_n": gripper.force_n,
    }


def _wiring_document(wiring: VacuumWiring | None) -> dict[str, Any]:
    if wiring is None:
        return {}
    switch = {} if wiring.input is None else {"vacuum_input": wiring.input}
    return {"vacuum_output": wiring.output, **switch, "vacuum_wait_s": wiring.wait_s}


def needed(raw: dict[str, Any], key: str, where: str) -> Any:
    """Return a value that has to be there; InputError names the key."""
    if raw.get(key) is None:
        raise InputError(f"{where} has no '{key}'; compare it with configs/cells/ur5e_2f85.yaml.")
    return raw[key]


def box(value: object, where: str, d: int) -> Array:
    """Return the (2, d) corners of a box, low and high; InputError says what is wrong with them."""
    if not isinstance(value, list) or len(value) != 2:
        raise InputError(f"{where} must be two corners, [low, high], not {fields.shown(value)}.")
    low, high = (fields.vector(v, f"{where}[{k}]", (d,)) for k, v in enumerate(value))
    if not (low < high).all():
        raise InputError(f"{where} is {fields.shown(value)}; the low corner must lie below the high one on every axis.")
    return read_only([low, high])
