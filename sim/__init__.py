"""What physics says: MuJoCo as a judge that shares nothing with the statics but the geometry."""

import sim.engine  # noqa: F401  isort: skip  (first: it says what keeps MuJoCo from starting)
from sim.questions import Questions
from sim.simulate import simulate
from sim.simulation import Simulation

__all__ = ["Questions", "Simulation", "simulate"]
