"""What people may rely on, and the module that each name is imported from at first use."""

from .cone_joints.designer import design
from .cone_joints.kinematic import Impossible
from .cone_joints.largest_tilt import design_as_asked
from .cone_joints.outcome import Designed, NarrowPart

__all__ = ["Designed", "Impossible", "NarrowPart", "design", "design_as_asked"]
