"""What physics says: MuJoCo as a judge that shares nothing with the statics but the geometry."""

from sim.simulate import Questions, Simulation, simulate

__all__ = ["Questions", "Simulation", "simulate"]
