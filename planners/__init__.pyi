"""What people may rely on, and the module that each name is imported from at first use."""

from .cone_joints.designer import Designed, NarrowPart, design
from .cone_joints.kinematic import Impossible

__all__ = ["Designed", "Impossible", "NarrowPart", "design"]
