"""Touching points with the arm of a fake controller: read only, guided, checked against the controller first."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from ur_cell import MODEL, environment, fake_controller, loopback, small_plan, undisturbed, written

from mocca_robot.plan.pose import six
from mocca_robot.ur.fake.controller import ask

CELL_FILE = Path(__file__).resolve().parents[2] / "configs" / "cells" / "ur5e_2f85.yaml"


def cell_file(folder: Path, mass_kg: float = 0.0) -> Path:
    """A cell with the tool that the fake has before anybody tells it another: none."""
    content = yaml.safe_load(CELL_FILE.read_text())
    content["gripper"].update(mass_kg=mass_kg, tcp_offset_m=[0, 0, 0])
    file = folder / "cell.yaml"
    file.write_text(yaml.safe_dump(content))
    return file


def command(*arguments: object) -> list[str]:
    code = "import sys; from mocca_robot.cli import main; sys.exit(main(sys.argv[1:]))"
    return [sys.executable, "-c", code, "register", *map(str, arguments)]


@undisturbed
def test_a_build_place_is_found_by_touching_it_and_written(tmp_path: Path) -> None:
    plan_file, host = written(small_plan(1), tmp_path), loopback(80)
    c, s = np.cos(0.3), np.sin(0.3)
    marks = [(0.0, 0.0), (0.1, 0.0), (0.0, 0.1), (0.1, 0.1)]
    with fake_controller(plan_file, host):
        tip = ask(host)["tcp"]
        offset = np.array(tip[:3])
        lines = [*command(cell_file(tmp_path, ask(host)["payload_kg"]), "build", "--robot", host)]
        lines += ["--points", "0,0;100,0;0,100;100,100", "-o", str(tmp_path / "found.yaml")]
        process = subprocess.Popen(
            lines, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment()
        )
        assert process.stdin is not None and process.stdout is not None
        begun = ask(host)["begun"]
        q = np.array(ask(host)["q"])
        for x, y in marks:
            while "hold still, press Enter" not in (line := process.stdout.readline()):
                assert line, process.stderr.read() if process.stderr else ""
            place = offset + np.array([c * x - s * y, s * x + c * y, 0.0])
            q = reach(place, q)
            ask(host, q=list(six(q)))
            process.stdin.write("\n")
            process.stdin.flush()
        out, err = process.communicate(timeout=60)
        assert process.returncode == 0, out + err
        assert ask(host)["begun"] == begun  # nothing was commanded
    found = yaml.safe_load((tmp_path / "found.yaml").read_text())["build"]
    assert found["origin_m"] == pytest.approx(offset.tolist(), abs=1e-3)
    assert found["yaw_deg"] == pytest.approx(np.rad2deg(0.3), abs=0.1)
    assert "agree to 0.0" in out


def reach(place: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Joints near `near` that put the flange to `place`, turned as it is there."""
    pose = np.array(MODEL.tcp_pose(near))
    return np.asarray(MODEL.solve_pose([*place, *pose[3:]], near))


@undisturbed
def test_a_payload_or_tool_that_is_not_the_cells_is_named_before_anybody_leads_the_arm(tmp_path: Path) -> None:
    plan_file, host = written(small_plan(1), tmp_path), loopback(81)
    with fake_controller(plan_file, host):
        ask(host, payload_kg=2.5)
        done = subprocess.run(
            command(cell_file(tmp_path, 0.9), "tray", "--robot", host, "--json"),
            input="\n" * 4,
            capture_output=True,
            text=True,
            env=environment(),
            timeout=60,
        )
    assert done.returncode == 2
    assert "payload of 2.50 kg" in json.loads(done.stdout)["error"] and "sink or rise" in done.stdout


@undisturbed
def test_an_input_that_ends_and_points_on_a_line_are_refused(tmp_path: Path) -> None:
    plan_file, host = written(small_plan(1), tmp_path), loopback(82)
    with fake_controller(plan_file, host):
        file = cell_file(tmp_path, ask(host)["payload_kg"])
        for keys, said in (("", "input has ended"), ("\n" * 3, "on one line")):
            done = subprocess.run(
                command(file, "build", "--robot", host, "-o", tmp_path / "no.yaml"),
                input=keys,
                capture_output=True,
                text=True,
                env=environment(),
                timeout=60,
            )
            assert done.returncode == 2 and said in done.stderr, done.stdout + done.stderr
    assert not (tmp_path / "no.yaml").exists()
