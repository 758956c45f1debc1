"""What physics says of the finished geometry: MuJoCo without friction, springs with Coulomb friction with it.

Statics tells them where to look first.
"""

import sim.engine  # noqa: F401  isort: skip  (first: it says what keeps MuJoCo from starting)
from mocca_robot.verdicts.physics import Simulation
from mocca_robot.verdicts.simulation_json import read_simulation, write_simulation
from sim.questions import Questions
from sim.show.mjcf import export_mjcf, export_urdf
from sim.simulate import simulate

__all__ = [
    "Questions",
    "Simulation",
    "export_mjcf",
    "export_urdf",
    "read_simulation",
    "simulate",
    "write_simulation",
]
