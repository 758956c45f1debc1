"""What people install: wheel and source archive build, work in an environment of their own, and name missing extras."""

from __future__ import annotations

import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest
from ur_cell import small_plan

from mocca_robot.cli import main
from mocca_robot.plan.plan import write_plan

ROOT = Path(__file__).parents[2]
SCARECROW = str(ROOT / "configs" / "scarecrow.yaml")


@pytest.mark.parametrize(
    ("module", "extra", "arguments"),
    [
        ("viser", "viewer", ["view", SCARECROW, "--export", "page.html"]),
        ("starlette", "studio", ["studio", "--no-browser"]),
        ("imageio_ffmpeg", "film", ["simulate", SCARECROW, "--states", "--film", "film.mp4"]),
        ("rtde_control", "robot", ["execute", "plan.json", "--robot", "127.0.0.1", "--confirm", "2022"]),
        ("typst", "manual", ["check", SCARECROW, "--picture", "picture.png"]),
        ("typst", "manual", ["manual", SCARECROW, "-o", "manual.pdf"]),
        (
            "distributed",
            "cluster",
            ["study", str(ROOT / "configs/studies/tower_alpha.yaml"), "--scheduler", "tcp://127.0.0.1:1"],
        ),
    ],
)
def test_without_an_extra_its_command_says_what_to_install(
    module: str, extra: str, arguments: list[str], tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    for name in [m for m in sys.modules if m.split(".")[0] == module]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, module, None)
    write_plan(small_plan(1), tmp_path / "plan.json")
    assert main(arguments) == 2
    said = capsys.readouterr().err
    assert "pip install" in said and f"mocca-robot[{extra}]" in said


def run(*command: object, cwd: Path) -> str:
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, cwd=cwd, timeout=900)
    assert done.returncode == 0, f"{command}\n{done.stdout[-2000:]}{done.stderr[-3000:]}"
    return done.stdout


@pytest.mark.long
def test_wheel_and_source_archive_work_where_nothing_else_is(tmp_path: Path) -> None:
    source, dist = tmp_path / "source", tmp_path / "dist"
    source.mkdir()
    archive = subprocess.run(["git", "archive", "HEAD"], cwd=ROOT, capture_output=True, check=True).stdout
    subprocess.run(["tar", "-x", "-C", source], input=archive, check=True)
    run(sys.executable, "-m", "venv", tmp_path / "build", cwd=tmp_path)
    python = tmp_path / "build" / "bin" / "python"
    run(python, "-m", "pip", "install", "--quiet", "build", cwd=tmp_path)
    run(python, "-m", "build", "--outdir", dist, source, cwd=tmp_path)
    (wheel,), (tar,) = dist.glob("*.whl"), dist.glob("*.tar.gz")
    with zipfile.ZipFile(wheel) as inside:
        names = set(inside.namelist())
    for path in [*(ROOT / "configs").rglob("*.yaml"), *(ROOT / "configs").rglob("*.svg")]:
        assert f"mocca_robot/examples/{path.relative_to(ROOT / 'configs').as_posix()}" in names
    for package in {p.parent.name for p in ROOT.glob("*/__init__.py")} - {"tests", "benchmarks"}:
        files = {p for p in (source / package).rglob("*") if p.is_file()}
        assert {p.relative_to(source).as_posix() for p in files} <= names
    with tarfile.open(tar) as inside_tar:
        assert any(n.endswith("/configs/igloo.yaml") for n in inside_tar.getnames())
    smoke(wheel, tmp_path / "one")


def smoke(wheel: Path, folder: Path) -> None:
    """Install `wheel` into a bare environment, outside of any checkout, and lead a newcomer's first minutes."""
    folder.mkdir()
    run(sys.executable, "-m", "venv", folder / "venv", cwd=folder)
    binaries = folder / "venv" / "bin"
    run(binaries / "python", "-m", "pip", "install", "--quiet", wheel, cwd=folder)
    command = binaries / "mocca-robot"
    assert "usage" in run(command, "--help", cwd=folder)
    assert "scarecrow" in run(command, "examples", cwd=folder)
    run(command, "examples", "scarecrow", "sphere", cwd=folder)
    assert "every verdict is positive" in run(command, "run", "examples/scarecrow.yaml", cwd=folder)
    assert "every verdict is positive" in run(command, "design", "examples/sphere.yaml", cwd=folder)
    run(command, "new", "bridge", cwd=folder)
    run(command, "design", "bridge.yaml", cwd=folder)
    run(command, "manual", "out/bridge", cwd=folder)
    run(command, "export", "out/sphere", "--format", "compas", "-o", "s.json", cwd=folder)
    assert "mujoco" in run(command, "info", cwd=folder)
    files = run(binaries / "python", "-c", "import mocca_robot; print(mocca_robot.__file__)", cwd=folder)
    assert str(folder) in files
