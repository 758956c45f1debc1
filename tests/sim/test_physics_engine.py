"""An OpenGL that is missing keeps films from being made, and nothing else."""

from __future__ import annotations

import os
import subprocess
import sys


def test_an_opengl_library_that_is_missing_costs_films_only() -> None:
    code = """
import sim.engine, mujoco, os
assert os.environ["MUJOCO_GL"] == "glx-of-another-world"
ball = "<mujoco><worldbody><body><freejoint/><geom size='1'/></body></worldbody></mujoco>"
model = mujoco.MjModel.from_xml_string(ball)
data = mujoco.MjData(model)
mujoco.mj_step(model, data)
print(round(float(data.qvel[2] / model.opt.timestep), 2))
"""
    environment = {**os.environ, "MUJOCO_GL": "glx-of-another-world"}
    result = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=120)
    assert result.returncode == 0, result.stderr
    assert result.stdout.strip() == "-9.81"
