"""What the README says works as printed."""

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from mocca_robot.cli import main

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")


def block(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.MULTILINE | re.DOTALL)


@pytest.fixture
def first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (example,) = block("json")
    json.loads(example)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "first.json").write_text(example, encoding="utf-8")
    return tmp_path


def test_the_first_design_falls_before_and_stands_after(first: Path) -> None:
    assert main(["check", "first.json"]) == 1
    assert main(["design", "first.json"]) == 0
    assert (first / "out" / "first" / "report.html").is_file()


def test_the_python_example_runs(first: Path) -> None:
    (example,) = block("python")
    code = f"{example}\nassert result.design.assembly.name == 'first'\nassert physics.states[-1].stands"
    done = subprocess.run([sys.executable, "-c", code], cwd=first, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_the_table_lists_every_command() -> None:
    from mocca_robot.cli.parser import build_parser

    listed = set(re.findall(r"^\| `([a-z-]+)", README, re.MULTILINE))
    commands = {a for action in build_parser()._actions if action.dest == "command" for a in (action.choices or ())}
    assert commands == listed


def test_the_yaml_example_has_known_keys_only() -> None:
    from mocca_robot.config.keys import section
    from mocca_robot.config.schema import KEYS
    from mocca_robot.files.documents import parse_yaml

    (example,) = block("yaml")
    assert set(parse_yaml(example, "README")) <= set(section(KEYS, ""))


def test_shown_commands_and_pictures_exist() -> None:
    from mocca_robot.cli.parser import build_parser

    shown = [line for text in block("sh") for line in text.splitlines() if line.startswith(".venv/bin/mocca-robot ")]
    assert len(shown) >= 4
    for line in shown:
        build_parser().parse_args(shlex.split(line, comments=True)[1:])
    pictures = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", README)
    assert pictures and all((Path(__file__).parents[2] / p).is_file() for p in pictures)
