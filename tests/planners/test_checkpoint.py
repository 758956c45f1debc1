"""An interrupted design keeps what it has, and goes on to the same end; another input starts anew."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from processes import hears_ctrl_c, posix_only

from mocca_robot.assembly import Assembly
from mocca_robot.cli import main
from mocca_robot.config.config import load
from mocca_robot.files.design_json import read_design
from mocca_robot.joints.options import JointOptions
from mocca_robot.verdicts.verification import verify
from planners.cone_joints.checkpoint import Checkpoint, design_identity, read_checkpoint
from planners.cone_joints.designer import design
from planners.cone_joints.outcome import Designed
from planners.cone_joints.search import SearchState, Stage

CONFIGS = Path(__file__).parents[2] / "configs"


def stopping_after(steps: int):  # type: ignore[no-untyped-def]
    """Return a progress function that presses Ctrl-C at the given step."""
    seen = []

    def show(what: str, worst: float) -> None:
        seen.append(what)
        if len(seen) == steps:
            raise KeyboardInterrupt

    return show


def same_joints(a: Designed, b: Designed) -> bool:
    pairs = zip(a.design.assembly.parts, b.design.assembly.parts)
    return all(np.allclose(p.shape.bounds, q.shape.bounds, atol=1e-9) for p, q in pairs) and [
        j.is_planar for j in a.design.joints
    ] == [j.is_planar for j in b.design.joints]


@pytest.mark.parametrize(("name", "steps"), [("horse", 4), ("scarecrow", 2)])
def test_an_interrupted_design_goes_on_to_the_end_it_would_have_reached(name: str, steps: int, tmp_path: Path) -> None:
    config = load(CONFIGS / f"{name}.yaml")
    whole = design(config.assembly, config.joints)
    identity = design_identity(config.assembly, config.joints, None)
    checkpoint = Checkpoint(tmp_path / "progress.json", identity)
    cut = design(config.assembly, config.joints, progress=stopping_after(steps), keep=checkpoint.keep)
    assert cut.interrupted is not None
    # What it has is an assembly like any other: closed parts that touch and do not overlap.
    assert verify(cut.design.assembly).part_overlap < 1e-6
    assert checkpoint.save() is not None

    found = read_checkpoint(tmp_path / "progress.json", identity)
    assert found.state is not None
    rest = design(config.assembly, config.joints, resume=found.state)
    assert rest.interrupted is None
    assert rest.achieved == whole.achieved
    assert rest.evaluations == whole.evaluations, "finished steps are not taken again, and count"
    assert same_joints(rest, whole)


def test_the_state_survives_the_file_bit_by_bit(tmp_path: Path) -> None:
    config = load(CONFIGS / "horse.yaml")
    states: list[SearchState] = []
    design(config.assembly, config.joints, keep=states.append)
    assert states[-1].stage is Stage.FINISHED
    for number, state in enumerate((states[0], states[-1])):
        checkpoint = Checkpoint(tmp_path / f"{number}.json", "x")
        checkpoint.keep(state)
        checkpoint.save()
        back = read_checkpoint(tmp_path / f"{number}.json", "x").state
        assert back is not None
        assert (back.stage, back.attempt) == (state.stage, state.attempt)
        for mine, theirs in ((back.polishing, state.polishing), (back.best, state.best)):
            assert (mine is None) == (theirs is None)
            if mine is not None and theirs is not None:
                for field in ("shape", "lean", "axis", "curved"):
                    assert np.array_equal(getattr(mine.parameters, field), getattr(theirs.parameters, field))


def test_what_was_made_from_something_else_is_not_gone_on_from(tmp_path: Path) -> None:
    config = load(CONFIGS / "sphere.yaml")
    assembly: Assembly = config.assembly
    identity = design_identity(assembly, config.joints, None)
    other = [
        design_identity(replace(assembly, alpha_rad=0.1), config.joints, None),
        design_identity(assembly, replace(config.joints, max_height=0.3), None),
        design_identity(assembly, config.joints, {"key": np.array([0.0, 0.0, -1.0])}),
        design_identity(replace(assembly, gravity=2.0 * assembly.gravity), config.joints, None),
    ]
    assert len({identity, *other}) == 5
    assert identity == design_identity(load(CONFIGS / "sphere.yaml").assembly, JointOptions(), {})
    checkpoint = Checkpoint(tmp_path / "p.json", identity)
    checkpoint.keep(SearchState())
    checkpoint.save()
    assert read_checkpoint(tmp_path / "p.json", identity).state is not None
    assert "another input" in read_checkpoint(tmp_path / "p.json", other[0]).why_not
    (tmp_path / "p.json").write_text('{"format": "mocca-robot/design-progress", "identity"')
    assert "cannot be read" in read_checkpoint(tmp_path / "p.json", identity).why_not
    assert read_checkpoint(tmp_path / "none.json", identity).why_not == ""


def test_ctrl_c_on_the_command_line_keeps_and_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import mocca_robot.cli.console as console

    class Pressed:
        count = 0

        def __call__(self, text: str) -> None:
            Pressed.count += "step" in text
            if Pressed.count == 2:
                Pressed.count += 1
                raise KeyboardInterrupt

    from contextlib import contextmanager

    @contextmanager
    def spinner(name: str):  # type: ignore[no-untyped-def]
        yield Pressed()

    monkeypatch.setattr(console, "_spinner", spinner)
    command = ["design", str(CONFIGS / "scarecrow.yaml"), "-o", str(tmp_path)]
    assert main([*command, "--json"]) == 130
    said = json.loads(capsys.readouterr().out)
    assert said["interrupted"] is True
    assert Path(said["files"]["progress"]).exists()
    assert len(read_design(tmp_path).assembly.parts) == 4

    assert main([*command, "--set", "alpha_deg=24"]) == 0
    assert "starts anew" in capsys.readouterr().err
    assert not (tmp_path / "design-progress.json").exists(), "a finished design leaves none"

    Pressed.count = 0
    assert main(command) == 130
    assert "goes on from there" in capsys.readouterr().err
    assert main(command) == 0
    assert "going on from" in capsys.readouterr().out


@pytest.mark.long
@posix_only
def test_a_real_interrupt_of_a_large_design_and_its_resume(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "mocca_robot.cli", "design", str(CONFIGS / "igloo.yaml"), "-o", str(tmp_path)]
    progress = tmp_path / "design-progress.json"
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, preexec_fn=hears_ctrl_c) as process:
        deadline = time.monotonic() + 300.0
        while not progress.exists() and time.monotonic() < deadline:
            time.sleep(0.2)
        os.kill(process.pid, signal.SIGINT)
        said, _ = process.communicate(timeout=120)
    assert process.returncode == 130
    assert "Interrupted during" in said
    assert len(read_design(tmp_path).assembly.parts) == len(load(CONFIGS / "igloo.yaml").assembly.parts)
    again = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert again.returncode == 0, again.stdout + again.stderr
    assert "going on from" in again.stdout
    assert not progress.exists()
