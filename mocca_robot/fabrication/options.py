"""What a designer may say about how flat parts are cut."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CutOptions:
    """How flat parts are cut from a sheet; metres.

    Attributes:
        kerf: width of the cut; outlines move outwards by half of it, so that parts come out at size.
        clearance: play between two neighbouring parts; every outline moves inwards by half of it.
        sheet_width: width of the sheet.
        spacing: distance between parts on the sheet.
        labels: engrave the parts' names.
    """

    kerf: float = 0.0
    clearance: float = 0.0
    sheet_width: float = 0.6
    spacing: float = 0.005
    labels: bool = True
