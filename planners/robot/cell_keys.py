"""Every key of a cell file: its kind, default, limits and meaning. Reading, reference page and JSON Schema use it."""

from __future__ import annotations

from mocca_robot.config.keys import Key
from mocca_robot.plan.arm_models import MODELS
from mocca_robot.plan.gripper import COMPUTE_BOX
from mocca_robot.plan.limits import NUMBERS, RAISABLE, SPEEDS, MotionLimits, bounds
from mocca_robot.plan.reader import GRIPPERS
from mocca_robot.plan.wiring import DEFAULT_WAIT_S, SIGNALS, WAIT_S

EXAMPLE = "configs/cells/ur5e_2f85.yaml"
GRIPPER_KINDS = ("parallel", "suction")

CELL_KEYS: tuple[Key, ...] = (
    Key("version", "integer", 1, "", "Version of the file's format.", low=1),
    Key("name", "name", None, "", "Name of the cell; `execute --confirm` may ask for it.", required=True),
    Key("serial", "name", None, "", "Serial number of the controller that a plan for this cell may move."),
    Key("robot", "choice", None, "", "The arm.", known=tuple(MODELS), required=True),
    Key("gripper", "mapping", None, "", "What the arm holds parts with, see below.", required=True),
    Key("table_m", "box", None, "m", "The table as a box: low and high corner.", size=3, required=True),
    Key("workspace_m", "box", None, "m", "The box that the tool centre point never leaves.", size=3, required=True),
    Key("build", "mapping", None, "", "Where and how large the structure is built, see below.", required=True),
    Key(
        "build.origin_m",
        "places",
        None,
        "m",
        "The point below the middle of the structure, or a list of points that planning chooses from; above the table, "
        "a plinth carries it.",
        required=True,
    ),
    Key(
        "build.yaw_deg",
        "turns",
        0.0,
        "deg",
        "Turn of the structure about z, a list of turns, or `auto` for twelve turns; planning chooses.",
    ),
    Key(
        "build.size_m",
        "number",
        None,
        "m",
        "Longest side of the structure after scaling; default: the design's own size.",
        above=0.0,
        high=10.0,
    ),
    Key(
        "build.thickness_m",
        "number",
        None,
        "m",
        "Thickness of flat parts; default: the design's own.",
        above=0.0,
        high=10.0,
    ),
    Key("build.supports", "names", None, "", "Parts that something else holds once they are placed; `all` for all."),
    Key(
        "build.cradles",
        "names",
        None,
        "",
        "Parts that a cradle made to the design's shape holds once they are let go, so that they come to lie exactly "
        "at their place; `all` for all.",
    ),
    Key("tray", "mapping", None, "", "Where parts wait, see below.", required=True),
    Key("tray.low_m", "vector", None, "m", "Low corner of the tray.", size=2, required=True),
    Key("tray.high_m", "vector", None, "m", "High corner of the tray.", size=2, required=True),
    Key("tray.nest_m", "number", 0.015, "m", "Height above the table at which nests hold parts.", low=0.0, high=0.2),
    Key("tray.gap_m", "number", 0.045, "m", "Distance between parts.", low=0.0, high=1.0),
    Key("tray.parts", "mapping", None, "", "Place of every part by name; default: a layout is made."),
    Key("tray.parts.NAME.at_m", "vector", None, "m", "Middle of the part's footprint.", size=2, required=True),
    Key("tray.parts.NAME.yaw_deg", "number", None, "deg", "Turn about z from how the part will stand."),
    Key(
        "tray.parts.NAME.turn_deg",
        "vector",
        None,
        "deg",
        "Turn from how the part will stand, as a rotation vector; in place of `yaw_deg`.",
        size=3,
    ),
    Key("obstacles", "mapping", None, "", "What else stands in the cell, by name; arm, tool and parts avoid it."),
    Key(
        "obstacles.NAME.box_m",
        "box",
        None,
        "m",
        "Low and high corner of a box that encloses it, before its turn.",
        size=3,
        required=True,
    ),
    Key("obstacles.NAME.yaw_deg", "number", 0.0, "deg", "Turn of the box about z, about its middle."),
    Key(
        "home_deg",
        "vector",
        None,
        "deg",
        "Joint angles in which a build begins and ends.",
        size=6,
        required=True,
    ),
    Key(
        "joint_range_deg",
        "vector",
        [360] * 6,
        "deg",
        "How far each joint may turn either way, where hoses and cables allow less than the arm.",
        size=6,
    ),
    Key("limits", "mapping", {}, "", "Caps of the driver by name, lowered; see below."),
)

_SHARED: tuple[Key, ...] = (
    Key("gripper.kind", "choice", "parallel", "", "Two fingers, or one suction cup.", known=GRIPPER_KINDS),
    Key(
        "gripper.tcp_offset_m",
        "vector",
        None,
        "m",
        "The middle between the pads, or of the cup's lip, in the flange's frame.",
        size=3,
        required=True,
    ),
    Key("gripper.mass_kg", "number", None, "kg", "Mass of the tool.", low=0.0, high=30.0, required=True),
    Key("gripper.cog_m", "vector", [0, 0, 0], "m", "The tool's centre of mass in the flange's frame.", size=3),
    Key(
        "gripper.palm_m",
        "box",
        None,
        "m",
        "Box around the hand, or around valve and flange, in the flange's frame.",
        size=3,
        required=True,
    ),
    Key("gripper.friction", "number", 0.5, "", "Between pads or lip and part.", low=0.01, high=2.0),
)

_PARALLEL: tuple[Key, ...] = (
    Key("gripper.name", "choice", "2f85", "", "The tool.", known=tuple(g for g in GRIPPERS if g != "suction")),
    Key("gripper.stroke_m", "vector", None, "m", "Smallest and largest opening.", size=2, required=True),
    Key(
        "gripper.finger_m",
        "box",
        None,
        "m",
        "Box around one finger, without its pad, when the gripper is closed, in the flange's frame; the other finger "
        "mirrors it in y.",
        size=3,
        required=True,
    ),
    Key("gripper.pad_radius_m", "number", 0.006, "m", "Radius of the pads; a part covers them.", low=0.0, high=0.1),
    Key(
        "gripper.opening_m",
        "number",
        0.012,
        "m",
        "How much wider than the part the fingers open.",
        low=0.002,
        high=0.1,
    ),
    Key("gripper.force_n", "number", 20.0, "N", "Force with which the fingers close.", low=1.0, high=235.0),
    Key("gripper.address", "text", None, "", f"Of the Compute Box of `rg2` and `rg6`; default: {COMPUTE_BOX}."),
    Key("gripper.close_output", "choice", None, "", "Of `digital`: output that closes the fingers.", known=SIGNALS),
    Key("gripper.open_output", "choice", None, "", "Output that opens them, with two coils.", known=SIGNALS),
    Key("gripper.open_input", "choice", None, "", "Input of the switch that shows them wide open.", known=SIGNALS),
    Key("gripper.held_input", "choice", None, "", "Input that shows something between them.", known=SIGNALS),
    Key(
        "gripper.switch_wait_s",
        "number",
        DEFAULT_WAIT_S,
        "s",
        "How long `digital` fingers may take.",
        low=WAIT_S[0],
        high=WAIT_S[1],
    ),
)

_SUCTION: tuple[Key, ...] = (
    Key("gripper.name", "choice", "suction", "", "The tool.", known=("suction",)),
    Key("gripper.stem_radius_m", "number", None, "m", "Radius of the stem.", low=0.001, high=0.1, required=True),
    Key("gripper.cup_radius_m", "number", None, "m", "Radius of the lip.", low=0.001, high=0.1, required=True),
    Key("gripper.bellows_m", "number", 0.0015, "m", "How uneven a part may be under the lip.", low=1e-4, high=0.02),
    Key("gripper.vacuum_kpa", "number", 60.0, "kPa", "Vacuum, below the air's pressure.", low=1.0, high=100.0),
    Key("gripper.vacuum_output", "choice", None, "", "Digital output that opens the valve.", known=SIGNALS),
    Key("gripper.vacuum_input", "choice", None, "", "Digital input of the vacuum switch.", known=SIGNALS),
    Key(
        "gripper.vacuum_wait_s",
        "number",
        DEFAULT_WAIT_S,
        "s",
        "How long vacuum may take to come or to go.",
        low=WAIT_S[0],
        high=WAIT_S[1],
    ),
)

GRIPPER_KEYS: dict[str, tuple[Key, ...]] = {
    "parallel": (*_SHARED, *_PARALLEL),
    "suction": (*_SHARED, *_SUCTION),
}
"""Kind of gripper → its keys."""


def _limit(name: str) -> Key:
    low, high = bounds(name)
    default = getattr(MotionLimits(), name)
    unit = next((u for end, u in _UNITS if name.endswith(end)), "")
    kind = "integer" if isinstance(default, int) else "number"
    said = "may only be raised" if high is None else "may only be lowered"
    if name in RAISABLE:
        said, high = f"larger arms have more; up to {RAISABLE[name]:g} with `accepted`", RAISABLE[name]
    if any(name in s for s in SPEEDS.values()):
        said = "may only be lowered; " + ", ".join(f"{p}: {s[name]:.4g}" for p, s in SPEEDS.items())
    return Key(f"limits.{name}", kind, default, unit, f"The driver's default; it {said}.", low=low, high=high)


_UNITS = (
    ("_m_s2", "m/s²"),
    ("_m_s", "m/s"),
    ("_rad_s2", "rad/s²"),
    ("_rad_s", "rad/s"),
    ("_rad", "rad"),
    ("_nm", "N·m"),
    ("_n", "N"),
    ("_hz", "Hz"),
    ("_m", "m"),
    ("_s", "s"),
)
LIMIT_KEYS: tuple[Key, ...] = (
    Key(
        "limits.preset",
        "choice",
        "reduced",
        "",
        "How fast the arm moves freely, lifts and retreats; `fenced` only with `accepted`.",
        known=tuple(SPEEDS),
    ),
    *map(_limit, NUMBERS),
    Key("limits.accepted", "name", None, "", "Who accepts that a cap is raised above the driver's, and why."),
)
"""The driver's caps as rows; `MotionLimits.lowered` checks them."""
