"""What a run found, for people: one self-contained page, a comparison page, and figures that stand alone."""

from mocca_robot.report.data import ReportData, Tilt, collect
from mocca_robot.report.page import write_report

__all__ = ["ReportData", "Tilt", "collect", "write_report"]
