"""MuJoCo that cannot start is an environment to mend, not a crash."""

from __future__ import annotations

import os
import subprocess
import sys


def test_an_opengl_library_that_is_missing_is_named_with_the_way_out() -> None:
    hidden = "import ctypes.util, sys\nctypes.util.find_library = lambda name: None\n"
    code = hidden + "import sim\n"
    environment = {**os.environ, "MUJOCO_GL": "glx-of-another-world"}
    result = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=120)
    assert result.returncode != 0
    assert "EnvironmentNeeded" in result.stderr
    assert "MUJOCO_GL=glx-of-another-world" in result.stderr and "unset MUJOCO_GL" in result.stderr
