"""MuJoCo's own viewer, where there is a screen."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from mocca_robot.assembly import Assembly
from mocca_robot.contacts.contact import Contact
from mocca_robot.errors import EnvironmentNeeded
from sim.shapes.contact_model import contact_model
from sim.show.film import visible_spec
from sim.stability import free_scene

NO_SCREEN = (
    "MuJoCo's viewer needs a screen, and there is none here (neither DISPLAY nor WAYLAND_DISPLAY is set). "
    "Without --mujoco the browser shows the same; `mocca-robot export X --format mjcf` writes the model for elsewhere."
)


def open_native_viewer(assembly: Assembly, contacts: Sequence[Contact], friction: float = 0.0) -> None:
    """Show the finished assembly, let go, until the window is closed. Raises EnvironmentNeeded without a screen."""
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise EnvironmentNeeded(NO_SCREEN)
    from mujoco import viewer

    scene = free_scene(assembly, contact_model(assembly, contacts, friction), friction=friction)
    viewer.launch(visible_spec(scene).compile())
