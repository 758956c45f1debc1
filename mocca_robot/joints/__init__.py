"""What replaces a contact: surfaces that are height fields along a principal direction, one family a file."""

from mocca_robot.joints.joint import Joint, contact_rays, planar

__all__ = ["Joint", "contact_rays", "planar"]
