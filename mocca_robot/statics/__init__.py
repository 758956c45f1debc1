"""Static equilibrium of rigid parts in frictionless or frictional contact (Eq. 2–10)."""

from mocca_robot.statics.equilibrium import (
    EquilibriumResult,
    Status,
    equilibrium,
)
from mocca_robot.statics.system import ContactSystem

__all__ = ["ContactSystem", "EquilibriumResult", "Status", "equilibrium"]
