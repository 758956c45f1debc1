"""What all tests share: a thread per solver, properties whatever the machine's mood, what a system cannot run."""

import os
from importlib.util import find_spec
from pathlib import Path

for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")  # before numpy: tests run side by side already

from hypothesis import HealthCheck, settings  # noqa: E402

# Deadlines measure the machine, not the code.
settings.register_profile("tests", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("tests")

UR = Path(__file__).parent / "ur"
NEEDS = {
    "ompl": ("planners/test_plan_build.py", "planners/test_plan_solids.py", "sim/test_rehearse.py"),
    "resource": ("files/test_fuzz.py",),
    "rtde_control": tuple(f"ur/{p.name}" for p in sorted(UR.glob("*.py")) if "fake_controller" in p.read_text("utf-8")),
}
"""Modules that not every Python and system has, and the files of tests that need them."""
_MISSING = [module for module in NEEDS if find_spec(module) is None]
collect_ignore = [file for module in _MISSING for file in NEEDS[module]]


def pytest_terminal_summary(terminalreporter) -> None:
    for module in _MISSING:
        terminalreporter.write_line(f"left out, because '{module}' is not installed here: {', '.join(NEEDS[module])}")
