"""Parameter studies: many designs of one assembly, side by side."""

from sim.studies.run import StudyResult, run_study
from sim.studies.study import Point, Study, read_study

__all__ = ["Point", "Study", "StudyResult", "read_study", "run_study"]
