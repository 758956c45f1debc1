"""STEP: the solids of an assembly, as fine triangles, by the names that their places in it have."""

from __future__ import annotations

from pathlib import Path

from mocca_robot.arrays import Array, IntArray
from mocca_robot.errors import InputError
from mocca_robot.files.glb import read_glb
from mocca_robot.files.native import read_apart, require_package

DEFLECTION_MM, TURN_RAD = 0.01, 0.1
"""How far triangles may be off a curved face, and how much neighbours may turn."""


def read_step(path: Path) -> list[tuple[str, Array, IntArray]]:
    """Return names, vertices (V, 3) in metres and triangles (F, 3) of every solid that a STEP file places.

    The unit is the file's own. Flat faces are exact but for the 32-bit numbers of the translation: 6e-8 of a part's
    size. Raises EnvironmentNeeded without the package `cascadio`, InputError for what it cannot read.
    """
    require_package("cascadio", "step", path, "OBJ or 3MF, one object per part")
    if not path.read_bytes()[:1000].lstrip().startswith(b"ISO-10303-21"):
        raise InputError(f"'{path}' cannot be read as STEP: it does not begin with 'ISO-10303-21'. Export it again.")
    return read_glb(read_apart("step", path, __name__), f"'{path}'")


def converted(path: Path) -> bytes:
    """Return a STEP file as GLB, by Open CASCADE, which a damaged file can end: call it in a process of its own."""
    import cascadio

    try:
        found = cascadio.load(
            path.read_bytes(), file_type="step", tol_linear=DEFLECTION_MM, tol_angular=TURN_RAD, use_parallel=False
        )
    except Exception as error:  # whatever the kernel throws
        raise InputError(f"'{path}' cannot be read as STEP: {error}. Export it again.") from None
    if not found:
        raise InputError(f"'{path}' cannot be read as STEP: it holds no shape. Export it again as AP214 or AP242.")
    return bytes(found)
