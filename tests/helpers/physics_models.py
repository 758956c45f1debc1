"""Small assemblies with known answers, for the physics tests."""

from __future__ import annotations

import itertools

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Mesh, Part, Polygon
from mocca_robot.contacts.contact import Contact
from mocca_robot.contacts.find import find_contacts
from mocca_robot.joints.build2d import build_parts_2d
from mocca_robot.joints.joint import Joint
from mocca_robot.joints.spline import polyline_joint

WIDTH = 0.05


def rectangle(x: float, y: float, width: float, height: float) -> Polygon:
    return Polygon(np.array([[x, y], [x + width, y], [x + width, y + height], [x, y + height]]))


def stack(blocks: int, shift: float = 0.0, height: float = WIDTH) -> Assembly:
    """Return squares on a wide floor, each `shift` further to the right than the one below."""
    floor = Part("floor", rectangle(-0.2, -0.05, 1.0, 0.05), fixed=True)
    free = (Part(f"b{k}", rectangle(k * shift, k * height, WIDTH, height)) for k in range(blocks))
    return Assembly("stack", (floor, *free))


def bump(contact: Contact, height: float, lean: float = 0.0, flank: int = 9) -> Joint:
    """Return a joint with one bump of `height` (share of the contact) along a leaning direction."""
    p, q = contact.polygon
    length = float(np.linalg.norm(q - p))
    c, s = np.cos(lean), np.sin(lean)
    u = np.array([c * contact.normal[0] - s * contact.normal[1], s * contact.normal[0] + c * contact.normal[1]])
    t = np.linspace(0.0, 1.0, flank)
    rise = t * t * (3.0 - 2.0 * t)
    x = np.concatenate([[0.0], 0.2 + 0.3 * t, (0.5 + 0.3 * t)[1:], [1.0]])
    y = np.concatenate([[0.0], rise, rise[::-1][1:], [0.0]]) * height * length
    return polyline_joint(contact, "n", u, p + x[:, None] * (q - p) + y[:, None] * u, {})


def jointed(assembly: Assembly, height: float = 0.2, lean: float = 0.0) -> tuple[Assembly, tuple[Contact, ...]]:
    """Return the assembly with a bump in every contact, and its contacts found anew."""
    built = build_parts_2d(assembly, [bump(c, height, lean) for c in find_contacts(assembly).contacts])
    return built, find_contacts(built).contacts


def box_mesh(low: tuple[float, float, float], high: tuple[float, float, float]) -> Mesh:
    import trimesh

    mesh = trimesh.creation.box(bounds=[low, high])
    return Mesh(mesh.vertices, mesh.faces)


def box_stack_3d(blocks: int) -> tuple[Assembly, tuple[Contact, ...]]:
    """Return cubes on a floor with their contacts given by hand."""
    floor = Part("floor", box_mesh((-0.2, -0.2, -0.05), (0.25, 0.25, 0.0)), fixed=True)
    free = [Part(f"b{k}", box_mesh((0, 0, k * WIDTH), (WIDTH, WIDTH, (k + 1) * WIDTH))) for k in range(blocks)]
    contacts = tuple(Contact((k, k + 1), square(k * WIDTH), np.array([0.0, 0.0, 1.0])) for k in range(blocks))
    return Assembly("cubes", (floor, *free)), contacts


def square(z: float) -> Array:
    return np.array([[0, 0, z], [WIDTH, 0, z], [WIDTH, WIDTH, z], [0, WIDTH, z]], dtype=np.float64)


def tongue(rise: float) -> Assembly:
    """Return a long block held out sideways by a short tongue that points along x, in the groove of a fixed one."""
    length, height, half = 0.2, 0.04, 0.0075
    back = [[0.0, height], [0.0, half], [-rise, half], [-rise, -half], [0.0, -half], [0.0, -height]]
    arm = Part("arm", Polygon(np.array([*back, [length, -height], [length, height]])))
    wall = Part("wall", Polygon(np.array([[-0.1, -height], *reversed(back), [-0.1, height]])), fixed=True)
    return Assembly("tongue", (wall, arm))


def semicircle(thickness: float, blocks: int = 27) -> Assembly:
    """Return a half circle of voussoirs of mean radius 1 m between two fixed feet."""
    inner, outer = 1.0 - 0.5 * thickness, 1.0 + 0.5 * thickness
    turns = np.linspace(np.pi, 0.0, blocks + 1)
    spokes = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    feet = (Part(n, rectangle(x, -0.1, thickness, 0.1), fixed=True) for n, x in (("left", -outer), ("right", inner)))
    stones = (
        Part(f"v{k}", Polygon(np.array([inner * a, inner * b, outer * b, outer * a])))
        for k, (a, b) in enumerate(itertools.pairwise(spokes))
    )
    return Assembly("half circle", (*feet, *stones))
