"""What the arm holds parts with: a parallel gripper or a suction cup, its shape and what it can hold."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.config.keys import read_whole
from mocca_robot.errors import InputError
from mocca_robot.files import fields
from mocca_robot.plan.gripper import FINGERS
from mocca_robot.plan.pose import Six, six, three
from mocca_robot.plan.wiring import FingerWiring, VacuumWiring
from mocca_robot.tolerances import ROUNDING
from planners.robot.cell_keys import EXAMPLE, GRIPPER_KEYS

GRAVITY = 9.81
SAFETY = 2.0
"""A tool holds this many times a part's weight: what the arm's own acceleration (0.5 m/s²) and doubt ask for."""


@dataclass(frozen=True, eq=False, kw_only=True)
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
        fingers: how fingers are wired that are only open or closed.
        address: where the gripper listens, if the controller does not serve it.
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
    fingers: FingerWiring | None = None
    address: str = ""

    def opened_m(self, width_m: float) -> float:
        """Return the opening in which the fingers go to a part, and leave it: some are only open or closed."""
        return self.stroke_m[1] if self.name == "digital" else width_m + self.opening_m

    def too_heavy(self, mass_kg: float) -> str:
        """Return '' or why a part of this mass would slip out of the fingers."""
        holds = 2.0 * self.friction * self.force_n / (SAFETY * GRAVITY)
        return "" if mass_kg <= holds else f"heavier than the fingers hold ({mass_kg:.2f} kg, at most {holds:.2f} kg)"


@dataclass(frozen=True, eq=False, kw_only=True)
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

    def opened_m(self, width_m: float) -> float:
        """Return the opening without vacuum."""
        return width_m + self.opening_m

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


def read_gripper(value: Any, where: str) -> Gripper:
    """Return the gripper of a cell file; InputError names the key, its value and what it has to be."""
    kind = "parallel"
    if isinstance(value, dict) and value.get("kind") is not None:
        kind = fields.choice(value["kind"], tuple(GRIPPER_KEYS), f"{where}.kind")
    raw = read_whole(GRIPPER_KEYS[kind], value, "gripper", where, EXAMPLE)
    tcp = six([*raw["tcp_offset_m"], 0.0, 0.0, 0.0])
    cog = three(raw["cog_m"])
    if kind == "suction":
        return SuctionGripper(
            name=raw["name"],
            tcp_offset=tcp,
            mass_kg=raw["mass_kg"],
            cog_m=cog,
            palm_m=raw["palm_m"],
            stem_radius_m=raw["stem_radius_m"],
            cup_radius_m=raw["cup_radius_m"],
            bellows_m=raw["bellows_m"],
            vacuum_pa=1e3 * raw["vacuum_kpa"],
            friction=raw["friction"],
            wiring=_wiring(value, raw, where),
        )
    stroke = raw["stroke_m"]
    _require_published(raw, where)
    if not 0.0 <= stroke[0] < stroke[1]:
        raise InputError(f"{where}.stroke_m is {stroke.tolist()}; give the smallest opening, then the largest.")
    return ParallelGripper(
        name=raw["name"],
        tcp_offset=tcp,
        mass_kg=raw["mass_kg"],
        cog_m=cog,
        stroke_m=(float(stroke[0]), float(stroke[1])),
        palm_m=raw["palm_m"],
        finger_m=raw["finger_m"],
        pad_radius_m=raw["pad_radius_m"],
        opening_m=raw["opening_m"],
        force_n=raw["force_n"],
        friction=raw["friction"],
        fingers=_finger_wiring(value, raw, where),
        address=_address(value, raw, where),
    )


def _require_published(raw: dict[str, Any], where: str) -> None:
    """Return if stroke and force are no larger than the maker of a known gripper publishes."""
    published = FINGERS.get(raw["name"])
    if published is None:
        return
    if raw["stroke_m"][1] > published.stroke_m + ROUNDING:
        raise InputError(
            f"{where}.stroke_m opens to {raw['stroke_m'][1]:g} m; a {raw['name']} opens to {published.stroke_m:g} m."
        )
    if raw["force_n"] > published.force_n[1]:
        raise InputError(
            f"{where}.force_n is {raw['force_n']:g}; a {raw['name']} grips with at most {published.force_n[1]:g} N."
        )


def _finger_wiring(written: dict[str, Any], raw: dict[str, Any], where: str) -> FingerWiring | None:
    names = ("close_output", "open_output", "open_input", "held_input")
    given = [n for n in (*names, "switch_wait_s") if written.get(n) is not None]
    if raw["name"] != "digital":
        if given:
            raise InputError(
                f"{where}.{given[0]} is for fingers behind outputs: write 'name: digital', or leave it out."
            )
        return None
    if raw["close_output"] is None:
        if given:
            raise InputError(f"{where}.{given[0]} is given, but not 'close_output': name the output that closes, too.")
        return None
    signals = {n: raw[n] for n in names}
    for a, b in (("close_output", "open_output"), ("open_input", "held_input")):
        if signals[a] is not None and signals[a] == signals[b]:
            raise InputError(f"{where}: {a} and {b} are both {signals[a]}; two signals need two pins.")
    return FingerWiring(**signals, wait_s=raw["switch_wait_s"])


def _address(written: dict[str, Any], raw: dict[str, Any], where: str) -> str:
    if written.get("address") is None:
        return ""
    if raw["name"] not in ("rg2", "rg6"):
        raise InputError(f"{where}.address is for 'rg2' and 'rg6'; a {raw['name']} is reached through the controller.")
    return str(raw["address"])


def _wiring(written: dict[str, Any], raw: dict[str, Any], where: str) -> VacuumWiring | None:
    if raw["vacuum_output"] is None:
        for key in ("vacuum_input", "vacuum_wait_s"):
            if written.get(key) is not None:
                raise InputError(f"{where}.{key} is given, but not 'vacuum_output': name the output of the valve, too.")
        return None
    return VacuumWiring(raw["vacuum_output"], raw["vacuum_input"], raw["vacuum_wait_s"])
