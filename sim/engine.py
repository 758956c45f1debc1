"""MuJoCo starts here: an OpenGL that keeps it from starting costs the films, never the numbers."""

from __future__ import annotations

import importlib
import os
import sys

from mocca_robot.errors import EnvironmentNeeded

_FAILURES = (ImportError, AttributeError, OSError, RuntimeError)


def _without_opengl(chosen: str, error: Exception) -> None:
    """Import MuJoCo again without the OpenGL that MUJOCO_GL names and that cannot be loaded.

    Importing MuJoCo loads that library, and a missing one fails in its own ways. Films ask for it again and say then
    what to install.
    """
    for name in [n for n in sys.modules if n.partition(".")[0] in ("mujoco", "OpenGL")]:
        if not name.startswith("mujoco._"):  # compiled modules stay: they can be loaded once only
            del sys.modules[name]
    os.environ["MUJOCO_GL"] = "disable"
    try:
        importlib.import_module("mujoco")
    except _FAILURES:
        raise EnvironmentNeeded(
            f"MuJoCo does not start with MUJOCO_GL={chosen} ({error}). Only films need OpenGL: unset MUJOCO_GL, or "
            "install its library (Debian: libosmesa6 for osmesa; libegl1, libegl-mesa0 and libgl1-mesa-dri for egl)."
        ) from error
    finally:
        os.environ["MUJOCO_GL"] = chosen


try:
    import mujoco  # noqa: F401
except _FAILURES as failure:
    asked = os.environ.get("MUJOCO_GL")
    if not asked:
        raise EnvironmentNeeded(
            f"MuJoCo does not start ({failure}); install it again: pip install mujoco."
        ) from failure
    _without_opengl(asked, failure)
