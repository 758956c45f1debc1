"""What people may rely on: every public name of mocca_robot, and the module that it is imported from at first use."""

from .actions import (
    AddedMass,
    BodyAcceleration,
    Combination,
    LineForce,
    PointForce,
    Pressure,
    Wind,
    Worker,
)
from .assembly import Assembly, Equilibrium, Interlocking, Lateral, Mesh, Part, Polygon, SupportFree
from .config.config import Config, load
from .config.schema import SimulationOptions
from .contacts.contact import Contact, ContactReport, NearMiss, Overlap
from .contacts.find import find_contacts, require_sound
from .design import CaseResult, Design, Insertion
from .errors import EnvironmentNeeded, InputError, MoccaError
from .fabrication.bill import Item, bill, bill_csv
from .fabrication.clearance import with_clearance
from .fabrication.cut import write_cut_dxf, write_cut_svg
from .fabrication.options import CutOptions
from .fabrication.print_bed import Placed, print_beds, write_beds
from .fabrication.walls import ThinPlace, thin_places
from .files.assembly_json import read_assembly, write_assembly
from .files.compas_read import assembly_from_compas
from .files.compas_write import write_compas
from .files.design_json import read_design, write_design
from .files.mesh_write import write_glb, write_parts
from .files.meshes import read_parts
from .generators import generate
from .geometry.cones import MotionCone, extreme_rays, generalized_normals, largest_cone
from .joints.joint import Joint
from .joints.options import JointOptions
from .motion.insertion import InsertionVerdict, insertion_verdicts
from .motion.parts_graph import Meeting, PartMotion, PartsGraph, PlacedPart
from .plan.dry_run import dry_run
from .plan.plan import Cell, Grasp, Move, MoveKind, Plan, Step, Waypoint, write_plan
from .plan.reader import read_plan
from .report.display import plot, show, write_report
from .runtime.executors import LocalProcesses, WorkerLost, completed, executor, mapped
from .statics.cases import CaseVerdict, critical_tilt, critical_tilts, solve_case, solve_cases_on
from .statics.equilibrium import equilibrium
from .statics.load_factor import LoadFactor, load_factors
from .statics.loads import LoadCase, load_cases, state_cases, tilted_gravity
from .statics.solution import EquilibriumResult, Status
from .verdicts.verification import Verification, verify

def load_ipython_extension(ipython: object) -> None: ...

__all__ = [
    "AddedMass",
    "Assembly",
    "BodyAcceleration",
    "CaseResult",
    "CaseVerdict",
    "Cell",
    "Combination",
    "Config",
    "Contact",
    "ContactReport",
    "CutOptions",
    "Design",
    "EnvironmentNeeded",
    "Equilibrium",
    "EquilibriumResult",
    "Grasp",
    "InputError",
    "Insertion",
    "InsertionVerdict",
    "Interlocking",
    "Item",
    "Joint",
    "JointOptions",
    "Lateral",
    "LineForce",
    "LoadCase",
    "LoadFactor",
    "LocalProcesses",
    "Meeting",
    "Mesh",
    "MoccaError",
    "MotionCone",
    "Move",
    "MoveKind",
    "NearMiss",
    "Overlap",
    "Part",
    "PartMotion",
    "PartsGraph",
    "Placed",
    "PlacedPart",
    "Plan",
    "PointForce",
    "Polygon",
    "Pressure",
    "SimulationOptions",
    "Status",
    "Step",
    "SupportFree",
    "ThinPlace",
    "Verification",
    "Waypoint",
    "Wind",
    "Worker",
    "WorkerLost",
    "assembly_from_compas",
    "bill",
    "bill_csv",
    "completed",
    "critical_tilt",
    "critical_tilts",
    "dry_run",
    "equilibrium",
    "executor",
    "extreme_rays",
    "find_contacts",
    "generalized_normals",
    "generate",
    "insertion_verdicts",
    "largest_cone",
    "load",
    "load_cases",
    "load_factors",
    "mapped",
    "plot",
    "print_beds",
    "read_assembly",
    "read_design",
    "read_parts",
    "read_plan",
    "require_sound",
    "show",
    "solve_case",
    "solve_cases_on",
    "state_cases",
    "thin_places",
    "tilted_gravity",
    "verify",
    "with_clearance",
    "write_assembly",
    "write_beds",
    "write_compas",
    "write_cut_dxf",
    "write_cut_svg",
    "write_design",
    "write_glb",
    "write_parts",
    "write_plan",
    "write_report",
]
