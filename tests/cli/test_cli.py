"""The command line from outside: exit status, streams, JSON, broken input, interruption, odd paths."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from processes import hears_ctrl_c, posix_only

from mocca_robot.cli import main

ROOT = Path(__file__).parents[2]
SLOPE = {
    "format": "mocca-robot/assembly",
    "version": 1,
    "units": "mm",
    "dimension": 2,
    "name": "slope",
    "parts": [
        {"name": "hill", "fixed": True, "polygon": [[0, 0], [150, 0], [150, 60], [0, 10]]},
        {"name": "stone", "polygon": [[30, 20], [120, 50], [120, 90], [30, 80]]},
        {"name": "hat", "polygon": [[48, 82], [102, 88], [75, 130]]},
    ],
    "goal": {"kind": "equilibrium"},
    "alpha_deg": 5,
}


@pytest.fixture
def slope(tmp_path: Path) -> Path:
    return written(tmp_path / "slope.json", SLOPE)


@pytest.fixture
def step(tmp_path: Path) -> Path:
    """Write a block on level ground: it stands as it is."""
    parts = [
        {"name": "ground", "fixed": True, "polygon": [[0, 0], [100, 0], [100, 20], [0, 20]]},
        {"name": "block", "polygon": [[30, 20], [70, 20], [70, 50], [30, 50]]},
    ]
    return written(tmp_path / "step.json", {**SLOPE, "name": "step", "parts": parts})


def written(path: Path, data: object) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(data), encoding="utf-8")
    return path


def command(*arguments: object, cwd: Path | None = None, env: dict[str, str] | None = None) -> Any:
    """Return the finished process of `mocca-robot arguments`."""
    return subprocess.run(
        [sys.executable, "-m", "mocca_robot.cli", *map(str, arguments)],
        capture_output=True,
        text=True,
        encoding="utf-8",
        cwd=cwd,
        env={**os.environ, **(env or {})},
        check=False,
    )


def only_json(text: str) -> dict[str, Any]:
    lines = text.splitlines()
    assert len(lines) == 1, text
    data = json.loads(lines[0])
    assert isinstance(data, dict)
    return data


def test_designed_written_and_verified(slope: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "out"
    assert main(["design", str(slope), "-o", str(folder)]) == 0
    out = capsys.readouterr().out
    for name in ("design.json", "cut.svg", "cut.dxf", "report.html"):
        assert (folder / name).stat().st_size > 0
    assert out.splitlines()[-1] == str(folder / "report.html")  # the report's path comes last
    assert "needs support" in out or "every verdict is positive" in out
    assert "kinematic design" in out and "realization" in out  # wall times by stage


def test_a_negative_verdict_names_what_moves(slope: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(slope)]) == 1
    out = capsys.readouterr().out
    assert "'stone', 'hat' would move" in out


def test_a_sound_structure_passes_the_check(step: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(step), "--json"]) == 0
    found = only_json(capsys.readouterr().out)
    assert found["ok"] and not found["findings"] and not found["deadlock"]
    # A block of width 40 and height 30 without friction slides as soon as the ground tilts; with friction 0.5 it
    # slides at atan 0.5, before it tips at atan(40/30).
    assert [t["critical_deg"] for t in found["tilt"]] == pytest.approx([0.0, 0.0], abs=1e-6)
    assert main(["check", str(step), "--friction", "0.5", "--json"]) == 0
    found = only_json(capsys.readouterr().out)
    assert [t["critical_deg"] for t in found["tilt"]] == pytest.approx([26.565, 26.565], abs=0.02)


def test_run_asks_physics_and_keeps_everything(slope: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    done = command("run", slope, "-o", folder, "--states", "--tilt", "--json")
    found = only_json(done.stdout)
    assert done.returncode == found["exit_status"] and done.returncode in (0, 1), done.stderr
    simulation = json.loads((folder / "simulation.json").read_text(encoding="utf-8"))
    assert simulation["format"] == "mocca-robot/simulation"
    assert [s["placed"] for s in simulation["states"]] == ["stone", "hat"]
    assert simulation["states"][-1]["stable"] and all(c["status"] == "equilibrium" for c in found["cases"])
    assert any(c["status"] == "not_in_equilibrium" for c in found["input_cases"])
    assert set(found["files"]) == {"design", "cut_svg", "cut_dxf", "simulation", "report"}
    assert all(Path(f).is_file() for f in found["files"].values())


def test_simulate_takes_a_design_folder_or_plain_parts(slope: Path, step: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    assert command("design", slope, "-o", folder).returncode == 0
    done = command("simulate", folder, "--states", "--json")
    assert done.returncode == 0, done.stdout + done.stderr
    assert Path(only_json(done.stdout)["files"]["simulation"]).parent == folder
    plain = command("simulate", slope, "-o", tmp_path / "plain", "--states", "--json")
    assert plain.returncode == 1
    falls = [f for f in only_json(plain.stdout)["findings"] if f["kind"] == "falls"]
    assert any("MuJoCo" in f["text"] and "stone" in f["parts"] for f in falls)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("{", "first.json"),
        ("", "first.json"),
        ('{"format": "mocca-robot/assembly", "version": 1}', "first.json"),
        (json.dumps({**SLOPE, "alpha_deg": 95}), "alpha_deg"),
        (json.dumps({**SLOPE, "alpa_deg": 5}), "alpha_deg"),
        (json.dumps({**SLOPE, "sequence": ["hill", "stone", "hut"]}), "hat"),
        (json.dumps({**SLOPE, "parts": [*SLOPE["parts"][:2], SLOPE["parts"][1]]}), "stone"),  # type: ignore[index, misc]
        (json.dumps({**SLOPE, "parts": SLOPE["parts"][:1]}), "free"),  # type: ignore[index]
        (json.dumps({**SLOPE, "goal": {"kind": "interlocking", "key": "ney"}}), "ney"),
    ],
)
@pytest.mark.parametrize("name", ["design", "check"])
def test_unusable_input_is_explained(
    name: str, content: str, says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "first.json"
    file.write_text(content, encoding="utf-8")
    output = ["-o", str(tmp_path / "out")] if name == "design" else []
    assert main([name, str(file), *output]) == 2
    streams = capsys.readouterr()
    assert says in streams.err and "Traceback" not in streams.err
    assert len(streams.err.splitlines()) <= 3
    assert main([name, str(file), *output, "--json"]) == 2
    assert says in only_json(capsys.readouterr().out)["error"]


def test_a_part_that_is_enclosed_names_its_blockers(tmp_path: Path) -> None:
    cup = [[0, 0], [60, 0], [60, 50], [50, 50], [50, 10], [10, 10], [10, 50], [0, 50]]
    parts = [
        {"name": "cup", "fixed": True, "polygon": cup},
        {"name": "lid", "polygon": [[0, 50], [60, 50], [60, 60], [0, 60]]},
        {"name": "cork", "polygon": [[10, 10], [50, 10], [50, 50], [10, 50]]},
    ]
    file = written(tmp_path / "bottle.json", {**SLOPE, "name": "bottle", "parts": parts})
    for arguments in (["check", file], ["design", file, "-o", tmp_path / "out"]):
        done = command(*arguments, "--json")
        assert done.returncode == 1, done.stderr
        findings = only_json(done.stdout)["findings"]
        assert findings and all(f["kind"] in ("blocked", "narrow") for f in findings)
        assert all(f["parts"] == ["cork", "cup", "lid"] for f in findings)
    # The right order: the cork goes in before the lid.
    done = command("check", file, "--set", "sequence=[cup, cork, lid]", "--set", "alpha_deg=null", "--json")
    assert done.returncode == 0, done.stdout


def test_a_key_that_locks_and_one_that_does_not(slope: Path, step: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(step), "--key", "block", "--json"]) == 0
    assert only_json(capsys.readouterr().out)["interlocks"] is True
    assert main(["check", str(slope), "--key", "hat", "--json"]) == 1
    found = only_json(capsys.readouterr().out)
    assert found["interlocks"] is False
    assert any(f["case"] == "interlocking" and "stone" in f["parts"] for f in found["findings"])
    assert main(["check", str(slope), "--key", "hut"]) == 2
    assert "hat" in capsys.readouterr().err


def test_what_only_slides_with_its_key_held_is_loose_until_sideways_loads_need_joints(tmp_path: Path) -> None:
    parts = [
        {"name": "table", "fixed": True, "polygon": [[0, 0], [300, 0], [300, 100], [0, 100]]},
        {"name": "board", "polygon": [[0, 100], [300, 100], [300, 130], [0, 130]]},
        {"name": "weight", "polygon": [[100, 130], [200, 130], [200, 200], [100, 200]]},
    ]
    goal = {"kind": "interlocking", "key": "weight"}
    for name, goals, code in (("flat", [goal], 1), ("joints", [goal, {"kind": "lateral", "angle_deg": 5}], 0)):
        file = written(tmp_path / f"{name}.json", {**SLOPE, "name": name, "parts": parts, "goal": goals})
        done = command("design", file, "-o", tmp_path / name, "--json")
        assert done.returncode == code, done.stderr
        assert [f["kind"] for f in only_json(done.stdout)["findings"]] == ["loose"] * code
        assert command("check", tmp_path / name / "design.json", "--key", "weight", "--json").returncode == code


def test_bounds_too_tight_for_any_joint_are_proven(slope: Path, tmp_path: Path) -> None:
    done = command("design", slope, "-o", tmp_path / "out", "--json", "--set", "joints.max_slope_deg=2")
    assert done.returncode == 1, done.stderr
    findings = only_json(done.stdout)["findings"]
    proof = next(f for f in findings if f["kind"] == "impossible")
    assert proof["parts"] == ["stone", "hat"] and proof["case"] == "gravity"
    assert (tmp_path / "out" / "report.html").is_file()  # to look at


def test_a_missing_file_and_a_wrong_argument(tmp_path: Path) -> None:
    done = command("run", tmp_path / "nothing.yaml")
    assert done.returncode == 2 and "nothing.yaml" in done.stderr and "Traceback" not in done.stderr
    assert command("run").returncode == 2
    assert command("desing", "x").returncode == 2


def test_floating_and_overlapping_parts_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    hill, stone, hat = SLOPE["parts"]  # type: ignore[misc]
    high = {**hat, "polygon": [[x, y + 40] for x, y in hat["polygon"]]}
    low = {**hat, "polygon": [[x, y - 5] for x, y in hat["polygon"]]}
    for other, says in ((high, "floats"), (low, "overlap")):
        file = written(tmp_path / "parts.json", {**SLOPE, "parts": [hill, stone, other]})
        assert main(["check", str(file)]) == 2
        err = capsys.readouterr().err
        assert says in err and "hat" in err


def test_nothing_is_lost_when_input_breaks(slope: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    assert main(["design", str(slope), "-o", str(folder)]) == 0
    before = {f.name: f.read_bytes() for f in folder.iterdir()}
    slope.write_text("{", encoding="utf-8")
    assert main(["design", str(slope), "-o", str(folder)]) == 2
    assert {f.name: f.read_bytes() for f in folder.iterdir()} == before


def test_spaces_and_other_alphabets(tmp_path: Path) -> None:
    folder = tmp_path / "mein Ordner – 石"
    parts = [{**p, "name": f"Stein {p['name']} ü石"} for p in SLOPE["parts"]]  # type: ignore[attr-defined]
    file = written(folder / "Hügel 1.json", {**SLOPE, "name": "Hügel / 石", "parts": parts})
    done = command("design", file.name, cwd=folder, env={"PYTHONIOENCODING": "ascii"})
    assert done.returncode == 0, done.stderr
    assert done.stdout.isascii()
    assert len(list(folder.glob("out/*/report.html"))) == 1


def test_an_unwritable_folder_is_said_before_the_work(slope: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    done = command("run", slope, "-o", tmp_path / "file" / "out")
    assert done.returncode == 2 and "written" in done.stderr and not done.stdout


def test_a_folder_given_for_a_file_takes_the_file(slope: Path, tmp_path: Path) -> None:
    there = tmp_path / "there"
    there.mkdir()
    assert main(["manual", str(slope), "-o", str(there)]) == 0
    assert main(["sequence", str(slope), "--friction", "2", "-o", f"{tmp_path}/new/"]) == 0
    assert (there / "manual.html").is_file() and (there / "bill.csv").is_file()
    assert (tmp_path / "new" / "assembly.json").is_file()


def test_piped_output_is_plain(slope: Path, tmp_path: Path) -> None:
    done = command("design", slope, "-o", tmp_path / "out", env={"FORCE_COLOR": "1"})
    assert "\x1b" not in done.stdout + done.stderr and not done.stderr
    assert done.returncode == 0


def test_overrides_from_the_command_line(slope: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(slope), "--json", "--set", "alpha_deg=12"]) == 1
    assert only_json(capsys.readouterr().out)["insertions"][0]["required_deg"] == pytest.approx(12.0)
    assert main(["check", str(slope), "--set", "alpa_deg=12"]) == 2
    assert "alpha_deg" in capsys.readouterr().err
    assert main(["check", str(slope), "--set", "alpha_deg"]) == 2
    assert "KEY=VALUE" in capsys.readouterr().err


def test_sections_are_overridden_key_by_key(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    written(tmp_path / "slope.json", SLOPE)
    config = tmp_path / "slope.yaml"
    config.write_text("model: slope.json\njoints: {kinds: [n], margin: 0.2}\n", encoding="utf-8")
    from mocca_robot import load
    from mocca_robot.cli.arguments import overrides

    found = load(config, overrides(["joints.margin=0.1", "joints.max_height=0.3"]))
    assert (found.joints.kinds, found.joints.margin, found.joints.max_height) == (("n",), 0.1, 0.3)


@posix_only
def test_ctrl_c_keeps_the_design(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    config = ROOT / "configs" / "leaning_tower_20.yaml"
    process = subprocess.Popen(
        [sys.executable, "-m", "mocca_robot.cli", "run", str(config), "-o", str(folder), "--threads", "1", "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=hears_ctrl_c,
    )
    try:
        trials = folder / "trials.jsonl"
        for _ in range(1200):
            if (trials.exists() and trials.stat().st_size) or process.poll() is not None:
                break
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=120)
    finally:
        process.kill()
    assert process.returncode == 130, (out, err)
    assert only_json(out)["interrupted"] is True and "Traceback" not in err
    simulation = json.loads((folder / "simulation.json").read_text(encoding="utf-8"))
    assert simulation["interrupted"] and simulation["states"]
    assert (folder / "report.html").stat().st_size > 0
    from mocca_robot import read_design

    assert len(read_design(folder).assembly.parts) == 14


def test_export(slope: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for kind in ("svg", "dxf", "json"):
        assert main(["export", str(slope), "--format", kind, "-o", str(tmp_path / f"parts.{kind}")]) == 0
        assert (tmp_path / f"parts.{kind}").stat().st_size > 0
    capsys.readouterr()
    assert main(["check", str(tmp_path / "parts.json"), "--json"]) == 1
    assert only_json(capsys.readouterr().out)["contacts"] == 2
    assert main(["export", str(slope), "--format", "stl", "--clearance", "40", "-o", str(tmp_path / "stl")]) == 2
    assert "cannot be made" in capsys.readouterr().err
    import mujoco

    assert main(["export", str(slope), "--format", "mjcf", "-o", str(tmp_path / "mjcf"), "--json"]) == 0
    (scene,) = only_json(capsys.readouterr().out)["files"]
    assert mujoco.MjModel.from_xml_path(scene).nbody >= 3
    assert main(["export", str(slope), "--format", "urdf", "-o", str(tmp_path / "urdf"), "--json"]) == 0
    assert len([f for f in only_json(capsys.readouterr().out)["files"] if f.endswith(".urdf")]) == 3


def test_info_has_worked_with_every_solver(capsys: pytest.CaptureFixture[str]) -> None:
    from importlib import metadata

    assert main(["info", "--json"]) == 0
    found = only_json(capsys.readouterr().out)
    for name in ("daqp", "piqp", "clarabel", "osqp", "numba"):
        assert found["solvers"][name] == metadata.version(name)
    assert found["packages"]["mujoco"] == metadata.version("mujoco")


def test_errors_of_our_own_are_not_swallowed(
    slope: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(*_: object) -> None:
        raise RuntimeError("wheel fell off")

    monkeypatch.setattr("mocca_robot.statics.cases.solve_case", broken)
    monkeypatch.setattr("mocca_robot.cli.input_findings.solve_case", broken)
    assert main(["check", str(slope)]) == 70
    err = capsys.readouterr().err
    assert "Traceback" in err and "wheel fell off" in err and "report" in err


@pytest.mark.parametrize("options", [(), ("--json",)])
def test_a_verdict_keeps_its_exit_status_when_nobody_reads_it(slope: Path, options: tuple[str, ...]) -> None:
    arguments = [sys.executable, "-m", "mocca_robot.cli", "check", str(slope), *options]
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None and process.stderr is not None
        process.stdout.close()
        said = process.stderr.read()
        assert process.wait(timeout=60) == 1
    assert b"Traceback" not in said and b"Exception" not in said
