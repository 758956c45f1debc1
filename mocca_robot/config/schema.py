"""Every key of a configuration: its kind, default, unit, limits and meaning. Reading and documentation both use it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mocca_robot.assembly import DEFAULT_DENSITY, DEFAULT_THICKNESS, STANDARD_GRAVITY
from mocca_robot.config.keys import Key
from mocca_robot.contacts.friction import TANGENTIAL_RATIO
from mocca_robot.fabrication.options import CutOptions
from mocca_robot.files import fields as checks
from mocca_robot.joints.families.heights import FEWEST, MOST
from mocca_robot.joints.options import FURTHER, JointOptions
from mocca_robot.strength.options import StrengthOptions

JOINT_KINDS = ("n", "z", "frustum", *FURTHER)
GENERATORS = ("shell", "frame", "stack", "wall", "arch", "dome")
MODEL_FILES = ("svg", "dxf", "json", "obj", "stl", "ply", "3mf", "glb", "3dm", "step", "stp")


@dataclass(frozen=True)
class SimulationOptions:
    """How physics looks at a design.

    Attributes:
        friction: Coulomb coefficient between parts.
        azimuths: directions of the tilt table, spread evenly (2D knows left and right only).
        directions: insertion directions on the rim of a part's cone (2D: its two edges).
        seed: of everything drawn at random.
    """

    friction: float = 0.0
    azimuths: int = 8
    directions: int = 8
    seed: int = 0


_J, _S, _C, _R = JointOptions(), SimulationOptions(), CutOptions(), StrengthOptions()


def _degrees(angle_rad: float) -> float:
    return round(float(np.rad2deg(angle_rad)), 9)


KEYS: tuple[Key, ...] = (
    Key("version", "integer", 1, "", "Version of the file's format; 1 need not be written.", low=1),
    Key("name", "name", None, "", "Name of the assembly, used for files and reports; default: the file's name."),
    Key(
        "model",
        "text",
        None,
        "",
        "The parts, relative to this file: a folder of meshes, or a file (.svg, .dxf, .json, .obj, .stl, .ply, .3mf, "
        ".glb, .3dm, .step).",
    ),
    Key(
        "generator",
        "mapping",
        None,
        "m",
        f"Instead of `model`: `kind` ({', '.join(GENERATORS)}) and that generator's parameters, in metres and degrees.",
    ),
    Key(
        "units",
        "choice",
        None,
        "",
        "Unit of the model's numbers and of the lengths in this file; default: what the model itself says.",
        known=tuple(checks.UNITS_M),
    ),
    Key(
        "scale",
        "number",
        1.0,
        "",
        "Factor on the model's size; 1, written down, also says that an unusual size is meant.",
        above=0.0,
        high=1e6,
    ),
    Key(
        "up",
        "choice",
        "z",
        "",
        "Which axis of a solid model's numbers points up; with y, as many modellers have it, (x, y, z) → (x, −z, y).",
        known=("z", "y"),
    ),
    Key(
        "rigid",
        "names",
        [],
        "",
        "Objects of a mesh file that are one part each, however many separate bodies they hold.",
    ),
    Key(
        "tolerance",
        "length_or_share",
        0.0,
        "units",
        "Faces this far apart, or this deep inside each other, are taken as touching: a length, or a share of the "
        "assembly's diagonal such as `0.02 %`; 0 = rounding only. `check --heal` mends what it accepts.",
    ),
    Key("fixed", "names", None, "", "Parts that stand on the ground; replaces what the model says."),
    Key(
        "sequence",
        "names",
        None,
        "",
        "Every free part in the order of assembly; default: the order of the model. `auto`: one is found together "
        "with the joints.",
    ),
    Key(
        "goal",
        "goals",
        "equilibrium",
        "",
        "What the design has to satisfy, one or a list of: `equilibrium`, `support_free`, "
        "`{kind: lateral, angle_deg, azimuths}`, `{kind: interlocking, key: NAME}`.",
    ),
    Key(
        "alpha_deg",
        "degrees",
        5.0,
        "deg",
        "Half-angle α of the cone of directions from which every part can be inserted; null = not asked for.",
        low=0.0,
        below=90.0,
    ),
    Key("density", "number", DEFAULT_DENSITY, "kg/m³", "Density of every part.", above=0.0, high=1e5),
    Key("thickness", "length", f"{DEFAULT_THICKNESS * 1e3:g} mm", "units", "Depth of flat parts.", above=0.0),
    Key(
        "parts",
        "mapping",
        None,
        "",
        "Settings of single parts by name: `density`, `fixed`, `grain`, `layers`, `material`, `thickness`.",
    ),
    Key("material", "name", None, "", "Material of every part, as tables of friction call it.", example="acrylic"),
    Key("parts.NAME.material", "name", None, "", "Material of this part."),
    Key(
        "materials",
        "mapping",
        None,
        "",
        "Own materials by name: `{mix: {density: 1100 kg/m³, stiffness: 4 GPa, poisson: 0.2, tension: 2 MPa, "
        "compression: 6 MPa}}`, and if known `shear`, `bearing`, `friction`, `source`, `direction` and `across` "
        "(see [Strength](strength.md)).",
    ),
    Key("grain", "axis", None, "", "Direction of the grain of every part of wood: a vector, or a word such as `up`."),
    Key("parts.NAME.grain", "axis", None, "", "Direction of the grain of this part."),
    Key(
        "layers",
        "axis",
        None,
        "",
        "Normal of the layers of every printed part; `flat` for flat parts that were printed lying down.",
    ),
    Key("parts.NAME.layers", "axis", None, "", "Normal of the layers of this part."),
    Key(
        "clamping",
        "entries",
        None,
        "",
        "With what force parts were driven together: `[{parts: [left, wedge], force_n: 50}]`. With friction, what "
        "stands only clamped may stand with it.",
    ),
    Key("parts.NAME.density", "number", None, "kg/m³", "Density of this part.", above=0.0, high=1e5),
    Key("parts.NAME.fixed", "boolean", None, "", "Whether this part stands on the ground."),
    Key("parts.NAME.thickness", "length", None, "units", "Depth of this flat part.", above=0.0),
    Key(
        "gravity",
        "vector",
        STANDARD_GRAVITY,
        "m/s²",
        "Gravity: a magnitude that points down (−y in 2D, −z in 3D), or a vector.",
    ),
    Key(
        "friction",
        "friction",
        0.0,
        "",
        "Coulomb coefficient, or one per pair of materials such as `{wood-wood: 0.4, wood-steel: 0.2}`, used for "
        "analysis and comparison; default: `joints.friction`, all that a design relies on.",
        low=0.0,
        high=10.0,
    ),
    Key(
        "stiffness_ratio",
        "number",
        TANGENTIAL_RATIO,
        "",
        "With friction: how stiff contact points are along themselves, over how stiff across, k_t/k_n. Bodies of one "
        "material have 0.7 to 1, rough faces less; `check` says how much the critical tilt changes from 0.3 to 3. The "
        "stiffness itself decides nothing.",
        above=0.0,
        high=1e3,
    ),
    Key(
        "loads",
        "loads",
        [],
        "",
        "Loads besides self-weight, a list of `{name, kind, …}`: `force`, `line`, `pressure`, `wind`, `mass`, "
        "`worker`, `acceleration`, every magnitude with its unit (see [Loads](loads.md)).",
    ),
    Key(
        "combinations",
        "loads",
        [],
        "",
        "Loads that act together, a list of `{name, gravity, factors: {LOAD: factor}, states}`; default: each load "
        "alone beside gravity.",
    ),
    Key(
        "insertion",
        "mapping",
        None,
        "",
        "Insertion directions by part name, the way the part moves as it goes in: `{NAME: [dx, dy]}` or three numbers.",
    ),
    Key("joints", "mapping", None, "", "Bounds on the joints, see below."),
    Key(
        "joints.kinds",
        "choices",
        list(_J.kinds),
        "",
        "Families of joints that the designer may use: one curved bump (n); flat parts also a bump and a dent (z), "
        "solid ones also a block with straight flanks (frustum), which holds more and is tried where bumps fail. After "
        "that come blocks that follow the contact's outline (outline), ribs along one side (rib), bumps with four free "
        "heights (free) and several bumps on a contact (several); only where named, grids of heights (heights). Solid "
        "parts begin with n, which has to be named, or with your `joints.profile`.",
        known=JOINT_KINDS,
    ),
    Key(
        "joints.alike",
        "boolean",
        _J.alike,
        "",
        "One shape for all curved joints, in proportion to their contacts; their directions may still differ.",
    ),
    Key(
        "joints.control_heights",
        "integer",
        _J.control_heights,
        "",
        "Control heights along each side of joints of the family `heights`.",
        low=FEWEST,
        high=MOST,
    ),
    Key(
        "joints.profile",
        "height field",
        [],
        "",
        "Your own shape for the joints of solid parts: rows of control heights along the contact's longer side, like "
        "`[[0.5, 1, 0.5], [0.5, 1, 0.5]]`. The designer scales it and may turn it over; it takes the place of n.",
    ),
    Key(
        "joints.max_slope_deg",
        "degrees",
        _degrees(_J.max_slope_rad),
        "deg",
        "Steepest angle between a joint and the contact that it replaces.",
        above=0.0,
        below=90.0,
    ),
    Key(
        "joints.min_radius",
        "length",
        _J.min_radius,
        "units",
        "Smallest radius of curvature, that of the cutting tool.",
        low=0.0,
    ),
    Key(
        "joints.margin",
        "number",
        _J.margin,
        "",
        "Distance a joint keeps to the part's boundary and to other joints, as a share of its contact's length "
        "(2D) or of the shorter side of its rectangle (3D).",
        low=0.0,
        below=0.5,
    ),
    Key(
        "joints.min_distance",
        "length",
        _J.min_distance,
        "units",
        "The same as a length; the larger one counts.",
        low=0.0,
    ),
    Key(
        "joints.min_contact",
        "length",
        _J.min_contact,
        "units",
        "Contacts that are shorter (3D: whose area has a smaller square root) stay planar.",
        low=0.0,
    ),
    Key(
        "joints.max_height",
        "number",
        _J.max_height,
        "",
        "Largest height of a bump as a share of its contact's length (3D: shorter side).",
        above=0.0,
        high=2.0,
    ),
    Key(
        "joints.piecewise_planar",
        "boolean",
        _J.piecewise_planar,
        "",
        "Flat flanks instead of curved ones, for saws and wires.",
    ),
    Key(
        "joints.tilt_margin_deg",
        "degrees",
        _degrees(_J.tilt_margin_rad),
        "deg",
        "Tilt in every direction that each required state should survive beyond what the goals ask for; "
        "`max`: the largest that is found.",
        low=0.0,
        high=45.0,
        known=("max",),
    ),
    Key(
        "joints.inset",
        "number",
        _J.inset,
        "",
        "Share by which contacts are narrowed and joints flattened while designing, as a reserve.",
        low=0.0,
        below=0.5,
    ),
    Key(
        "joints.alpha_margin_deg",
        "degrees",
        _degrees(_J.alpha_margin_rad),
        "deg",
        "Insertion cone asked for beyond `alpha_deg` while designing, as a reserve.",
        low=0.0,
        high=45.0,
    ),
    Key(
        "joints.friction",
        "number",
        _J.friction,
        "",
        "Coulomb coefficient that the design may count on, reduced by `friction_safety`: fewer and shallower joints.",
        low=0.0,
        high=10.0,
    ),
    Key(
        "joints.friction_safety",
        "number",
        _J.friction_safety,
        "",
        "Factor by which the design counts on less friction than `joints.friction`.",
        low=1.0,
        high=100.0,
    ),
    Key(
        "strength",
        "mapping",
        None,
        "",
        "What is asked of the strength of parts and joints, see below; with it `run` asks for it, too.",
    ),
    Key(
        "strength.safety",
        "number",
        _R.safety,
        "",
        "How many times its loads every part has to bear.",
        low=1.0,
        high=1e6,
    ),
    Key(
        "strength.insertion_force",
        "force",
        None,
        "",
        "Force with which every part is pushed in, such as `20 N`; each insertion is then a load case.",
        example="20 N",
    ),
    Key(
        "strength.grip_force",
        "force",
        None,
        "",
        "Force with which a gripper holds every part across its thickness at its centre, such as `50 N`.",
        example="50 N",
    ),
    Key(
        "strength.elements",
        "number",
        _R.elements,
        "",
        "Largest size of a finite element, as a share of its part's size.",
        low=0.005,
        high=0.5,
    ),
    Key("simulate", "mapping", None, "", "Settings of the physics simulation, see below."),
    Key(
        "simulate.friction", "number", _S.friction, "", "Coulomb coefficient; default: `friction`.", low=0.0, high=10.0
    ),
    Key("simulate.azimuths", "integer", _S.azimuths, "", "Directions in which solids are tilted.", low=1, high=360),
    Key(
        "simulate.directions",
        "integer",
        _S.directions,
        "",
        "Directions on the rim of each part's cone from which a solid is inserted.",
        low=1,
        high=1000,
    ),
    Key("simulate.seed", "integer", _S.seed, "", "Seed of everything drawn at random.", low=0, high=2**31 - 1),
    Key("cut", "mapping", None, "", "Settings of the drawings for cutting flat parts, see below."),
    Key("cut.kerf", "length", _C.kerf * 1e3, "mm", "Width of the cut; outlines move outwards by half of it.", low=0.0),
    Key(
        "cut.clearance",
        "length",
        _C.clearance * 1e3,
        "mm",
        "Play between neighbours; every outline moves inwards by half of it.",
        low=0.0,
    ),
    Key("cut.sheet_width", "length", _C.sheet_width * 1e3, "mm", "Width of the sheet.", above=0.0),
    Key("cut.spacing", "length", _C.spacing * 1e3, "mm", "Distance between parts on the sheet.", low=0.0),
    Key("cut.labels", "boolean", _C.labels, "", "Whether the parts' names are engraved."),
)
"""The table: one row per key, in the order of the documentation."""
