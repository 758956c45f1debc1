"""Starting: a configuration for one's own model, the examples, and what a configuration comes to."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from mocca_robot.cli import main
from mocca_robot.config.config import load
from mocca_robot.config.examples import examples
from mocca_robot.config.schema import KEYS
from mocca_robot.contacts.find import find_contacts, require_sound
from mocca_robot.files.documents import parse_yaml, yaml_text

ROOT = Path(__file__).parents[2]
CONFIGS = ROOT / "configs"


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_two_commands_lead_to_a_verified_design(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["new", "bridge"]) == 0
    assert main(["run", "bridge.yaml", "--states", "--tilt"]) == 0
    said = capsys.readouterr().out
    assert "every verdict is positive" in said and (here / "out" / "bridge" / "design.json").is_file()
    before = load("bridge.yaml").assembly
    assert main(["check", "bridge.yaml"]) == 1, "without joints it must not hold, else there is nothing to see"
    assert [p.name for p in before.parts if p.fixed] == ["foot_left", "foot_right"]


@pytest.mark.parametrize(
    ("source", "options", "kind", "parts"),
    [
        ("models/scarecrow.svg", [], "parts", 4),
        ("models/horse.obj", ["--units", "m"], "parts", 13),
        ("models/lilium_tower.obj", ["--units", "m"], "shell", 139),
        ("models/pavilion.json", [], "frame", 48),
    ],
)
def test_new_writes_a_configuration_that_loads(
    here: Path, capsys: pytest.CaptureFixture[str], source: str, options: list[str], kind: str, parts: int
) -> None:
    assert main(["new", "mine", "--from", str(CONFIGS / source), *options, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["kind"], found["parts"]) == (kind, parts)
    assert [f.name for f in here.iterdir()] == ["mine.yaml"], "the model stays where it is"
    config = load("mine.yaml")
    require_sound(config.assembly, find_contacts(config.assembly))


SECTIONS = ("joints.", "strength.", "simulate.")


@pytest.mark.parametrize(
    ("options", "sections"),
    [([], (*SECTIONS, "cut.")), (["--from", str(CONFIGS / "models/horse.obj"), "--units", "m"], SECTIONS)],
)
def test_every_key_of_the_new_configuration_can_be_uncommented(
    here: Path, options: list[str], sections: tuple[str, ...]
) -> None:
    assert main(["new", "mine", *options]) == 0
    text = Path("mine.yaml").read_text(encoding="utf-8")
    head, _, rest = text.partition("# Everything else")
    lines = [line.removeprefix("# ") for line in rest.splitlines()[1:]]
    Path("all.yaml").write_text(head + "\n".join(lines), encoding="utf-8")
    config = load("all.yaml")
    written = {v.key for v in config.values if v.origin == "configuration"}
    assert {k.name for k in KEYS if k.name.startswith(sections)} <= written
    section = ""
    for line in lines:  # each by itself, too
        section = line if line.endswith(":") else section if line.startswith("  ") else ""
        if line.strip() and line != section:
            Path("one.yaml").write_text("\n".join([head, section, line, ""]), encoding="utf-8")
            key = section.replace(":", ".") + line.partition(":")[0].strip()
            assert key in {v.key for v in load("one.yaml").values if v.origin == "configuration"}


def test_an_example_is_one_of_its_key() -> None:
    shown = [k for k in KEYS if k.example is not None]
    assert {k.name for k in KEYS if k.kind == "force"} <= {k.name for k in shown}
    for key in shown:
        assert key.default is None and key.value(key.example, key.name) is not None


def test_nothing_is_overwritten(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for file in ("bridge.yaml", "other.svg"):
        Path(file).write_text("mine", encoding="utf-8")
    assert main(["new", "bridge"]) == 2
    assert main(["new", "other"]) == 2
    assert "there already" in capsys.readouterr().err
    assert Path("bridge.yaml").read_text(encoding="utf-8") == Path("other.svg").read_text(encoding="utf-8") == "mine"
    assert sorted(f.name for f in here.iterdir()) == ["bridge.yaml", "other.svg"]


@pytest.mark.parametrize("name", ["../out", "a/b", "", ".hidden", "-o", "x.yaml", "a\0b", "con:"])
def test_names_that_are_no_file_names_are_refused(here: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    assert main(["new", "--", name]) == 2
    assert list(here.iterdir()) == []


def test_a_model_given_as_name_is_told_from_it(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("my roof.svg").write_text("mine", encoding="utf-8")
    assert main(["new", "my roof.svg"]) == 2
    assert "mocca-robot new 'my roof' --from 'my roof.svg'" in capsys.readouterr().err
    assert [f.name for f in here.iterdir()] == ["my roof.svg"]


def test_a_mesh_without_unit_is_asked_for_it_with_the_sizes(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = here / "stones"
    folder.mkdir()
    for k in range(2):
        box = trimesh.creation.box((100, 100, 100))
        box.apply_translation((0, 0, 50 + 100 * k))
        box.export(folder / f"s{k}.stl")
    assert main(["new", "pile", "--from", "stones"]) == 2
    said = capsys.readouterr().err
    assert "--units mm (0.245 m across)" in said and "--units m (245 m across)" in said
    assert main(["new", "pile", "--from", "stones", "--units", "mm"]) == 0
    config = load("pile.yaml")
    assert config.assembly.sequence == ("s0", "s1") and config.assembly.parts[0].fixed


def test_names_of_any_kind_survive(here: Path) -> None:
    folder = here / "Müller & Söhne"
    folder.mkdir()
    drawing = folder / "Größe 1.svg"
    drawing.write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="100mm" height="100mm" viewBox="0 0 100 100">'
        '<rect id="it&apos;s &quot;a&quot;: [b], {c}" x="10" y="50" width="80" height="20"/>'
        '<rect id="日本/石 🪨 #1" x="20" y="30" width="60" height="20"/>'
        '<rect id="true" x="30" y="10" width="9" height="20"/>'
        "</svg>",
        encoding="utf-8",
    )
    assert main(["new", "Größe 1", "--from", str(drawing), "-o", str(folder)]) == 0
    config = load(folder / "Größe 1.yaml")
    assert set(config.assembly.sequence) == {'it\'s "a": [b], {c}', "日本/石 🪨 #1", "true"}


@pytest.mark.parametrize(
    "value", ["yes", "1", "a: b", "x #y", " ", "é", "a-b", ["a", "b, c"], {"k": "v"}, None, True, 1e-9]
)
def test_yaml_text_is_read_back(value: object) -> None:
    assert parse_yaml(f"key: {yaml_text(value)}", "text") == {"key": value}


def test_every_example_is_listed_and_copied_with_what_it_needs(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["examples", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)["examples"]
    assert {e["name"] for e in listed} >= {p.stem for p in CONFIGS.glob("*.yaml")}
    assert all(len(e["about"]) > 20 for e in listed)
    assert main(["examples", "--all", "-o", "copy"]) == 0
    for example in examples():
        if "/" not in example.name:
            load(Path("copy") / f"{example.name}.yaml")
    assert main(["examples", "--all", "-o", "copy"]) == 0, "the same content again is no conflict"
    Path("copy/m.yaml").write_text("changed", encoding="utf-8")
    assert main(["examples", "m", "tree", "-o", "copy"]) == 2
    assert Path("copy/m.yaml").read_text(encoding="utf-8") == "changed"
    assert main(["examples", "scarcrow"]) == 2
    assert "did you mean 'scarecrow'" in capsys.readouterr().err


def test_config_show_says_where_every_value_comes_from(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = f"model: {yaml_text(str(CONFIGS / 'models/scarecrow.svg'))}\nfixed: [body]\njoints:\n  margin: 0.1\n"
    text += "parts: {head: {density: 700}}\n"
    Path("c.yaml").write_text(text, encoding="utf-8")
    assert main(["config", "show", "c.yaml", "--set", "alpha_deg=7", "--json"]) == 0
    values = {v["key"]: (v["value"], v["source"]) for v in json.loads(capsys.readouterr().out)["values"]}
    assert values["fixed"] == (["body"], "c.yaml:2")
    assert values["joints.margin"] == (0.1, "c.yaml:4")
    assert values["parts.head.density"] == (700, "c.yaml:5")
    assert values["alpha_deg"] == (7, "--set")
    assert values["joints.inset"] == (0.02, "default")
    assert values["sequence"][0] == ["body", "arm_left", "arm_right", "head"]
    assert main(["config", "show", "c.yaml", "--set", "alpha_deg=7"]) == 0
    shown = capsys.readouterr().out
    again = parse_yaml("\n".join(line for line in shown.splitlines() if ": null" not in line), "shown")
    again["model"] = str(CONFIGS / "models/scarecrow.svg")
    Path("again.yaml").write_text(json.dumps(again), encoding="utf-8")
    assert load("again.yaml").assembly.sequence == load("c.yaml").assembly.sequence


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        (["desing", "x"], "design"),
        (["check", "x", "--picure", "y"], "--picture"),
        (["export", "x", "--format", "compass"], "compas"),
        (["config", "shwo", "x"], "show"),
    ],
)
def test_unknown_words_come_with_the_nearest_known_one(
    typed: list[str], meant: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["mocca-robot", *typed])
    with pytest.raises(SystemExit) as left:
        main()
    assert left.value.code == 2
    assert f"did you mean {meant}?" in capsys.readouterr().err


def test_info_says_when_a_robot_does_not_answer(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", "--robot", "127.0.0.111", "--json"]) == 1
    assert "No robot answers at 127.0.0.111" in json.loads(capsys.readouterr().out)["robot"]["problem"]


def test_windows_newlines_and_byte_order_marks_are_read(here: Path) -> None:
    assert main(["new", "bridge"]) == 0
    for name in ("bridge.yaml", "bridge.svg"):
        text = Path(name).read_text(encoding="utf-8")
        Path(name).write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())
    assert len(load("bridge.yaml").assembly.parts) == 5


def test_a_new_configuration_asks_for_no_more_alpha_than_the_contacts_allow(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A wedge whose flanks lean by 3° each goes in within 3°; 5° would be refused."""
    lean = 0.2 * np.tan(np.deg2rad(3.0))
    left = [[0, 0], [0.2, 0], [0.2, 0.1], [0.1, 0.1], [0.1 - lean, 0.3], [0, 0.3]]
    right = [[0.2, 0], [0.4, 0], [0.4, 0.3], [0.3 + lean, 0.3], [0.3, 0.1], [0.2, 0.1]]
    wedge = [[0.1, 0.1], [0.3, 0.1], [0.3 + lean, 0.3], [0.1 - lean, 0.3]]
    parts = [{"name": n, "polygon": p} for n, p in (("left", left), ("right", right), ("wedge", wedge))]
    data = {"format": "mocca-robot/assembly", "version": 1, "dimension": 2, "units": "m", "parts": parts}
    (here / "wedge.json").write_text(json.dumps(data), encoding="utf-8")
    assert main(["new", "groove", "--from", "wedge.json"]) == 0
    assert "no order" not in capsys.readouterr().err
    assert "the contacts allow up to 3.0°" in Path("groove.yaml").read_text(encoding="utf-8")
    alpha = load(Path("groove.yaml")).assembly.alpha_rad
    assert alpha is not None and 2.8 <= np.rad2deg(alpha) < 3.01
