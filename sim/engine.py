"""MuJoCo starts here: what keeps it from starting is said in words, once, before anything else needs it."""

from __future__ import annotations

import os

from mocca_robot.errors import EnvironmentNeeded

try:
    import mujoco  # noqa: F401
except (ImportError, AttributeError, OSError, RuntimeError) as error:
    # With MUJOCO_GL set, importing MuJoCo loads that OpenGL library, and a missing one fails in its own ways.
    chosen = os.environ.get("MUJOCO_GL")
    if not chosen:
        raise EnvironmentNeeded(f"MuJoCo does not start ({error}); install it again: pip install mujoco.") from error
    raise EnvironmentNeeded(
        f"MuJoCo does not start with MUJOCO_GL={chosen} ({error}). Only films need OpenGL: unset MUJOCO_GL, or install "
        "its library (Debian: libosmesa6 for osmesa; libegl1, libegl-mesa0 and libgl1-mesa-dri for egl)."
    ) from error
