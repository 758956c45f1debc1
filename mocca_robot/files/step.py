"""STEP: the solids of an assembly, as fine triangles, by the names that their places in it have."""

from __future__ import annotations

from pathlib import Path

from mocca_robot.arrays import Array, IntArray
from mocca_robot.errors import EnvironmentNeeded, InputError
from mocca_robot.files.glb import read_glb

DEFLECTION_MM, TURN_RAD = 0.01, 0.1
"""How far triangles may be off a curved face, and how much neighbours may turn."""


def read_step(path: Path) -> list[tuple[str, Array, IntArray]]:
    """Return names, vertices (V, 3) in metres and triangles (F, 3) of every solid that a STEP file places.

    The unit is the file's own. Flat faces are exact but for the 32-bit numbers of the translation: 6e-8 of a part's
    size. Raises EnvironmentNeeded without the package `cascadio`, InputError for what it cannot read.
    """
    try:
        import cascadio
    except ImportError:
        raise EnvironmentNeeded(
            f"'{path}' is a STEP file; reading it needs the package cascadio: pip install 'mocca-robot[step]'. Or "
            "export the parts as OBJ or 3MF."
        ) from None
    content = path.read_bytes()
    if not content.lstrip().startswith(b"ISO-10303-21"):
        raise InputError(f"'{path}' cannot be read as STEP: it does not begin with 'ISO-10303-21'. Export it again.")
    try:
        found = cascadio.load(
            content, file_type="step", tol_linear=DEFLECTION_MM, tol_angular=TURN_RAD, use_parallel=False
        )
    except Exception as error:  # whatever the kernel throws
        raise InputError(f"'{path}' cannot be read as STEP: {error}. Export it again.") from None
    if not found:
        raise InputError(f"'{path}' cannot be read as STEP: it holds no shape. Export it again as AP214 or AP242.")
    return read_glb(found, f"'{path}'")
