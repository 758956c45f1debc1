"""The documentation: every example runs, everything public has its place, generated pages are what the code says."""

from __future__ import annotations

import importlib.util
import json
import re
import shlex
import shutil
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import jsonschema
import pytest
import yaml
from ur_cell import small_plan

from mocca_robot.cli import main
from mocca_robot.cli.parser import build_parser
from mocca_robot.cli.reasons import NegativeVerdict
from mocca_robot.config.config import load
from mocca_robot.config.keys import Key
from mocca_robot.config.schema import KEYS
from mocca_robot.errors import InputError, MoccaError
from mocca_robot.files.assembly_json import write_assembly
from mocca_robot.plan.plan import document
from planners.robot.cell import read_cell
from planners.robot.cell_keys import CELL_KEYS, GRIPPER_KEYS, LIMIT_KEYS
from sim.studies.study import STUDY_KEYS

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(p.relative_to(DOCS).as_posix() for p in DOCS.rglob("*.md"))
CONFIGS = sorted((ROOT / "configs").glob("*.yaml"))
EXECUTED = ("sh", "python")
DATA = ("json", "yaml", "xml")
BLOCK = re.compile(
    r"^(?:<!-- (?P<order>[^\n]*?) -->\n)?```(?P<language>\w*)\n(?P<text>.*?)^```", re.MULTILINE | re.DOTALL
)


@dataclass(frozen=True)
class Block:
    """A fenced block and the order in the comment before it: 'run', 'run: exit 1', 'file: NAME', 'not run: WHY'."""

    language: str
    text: str
    order: str


def blocks(page: str) -> Iterator[Block]:
    for found in BLOCK.finditer((DOCS / page).read_text(encoding="utf-8")):
        yield Block(found["language"], found["text"], found["order"] or "")


def text(page: str) -> str:
    return (DOCS / page).read_text(encoding="utf-8")


def commands(text: str) -> Iterator[list[str]]:
    for line in text.splitlines():
        if line.startswith("mocca-robot "):
            yield shlex.split(line, comments=True)[1:]


def generator() -> ModuleType:
    spec = importlib.util.spec_from_file_location("docs_generate", DOCS / "generate.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


GENERATE = generator()


@pytest.mark.parametrize("page", [p for p in PAGES if any(b.order.startswith("run") for b in blocks(p))])
def test_examples_of_a_page_run_in_order(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if page == "tutorials/robot-dry-run.md":
        pytest.importorskip("ompl")  # has wheels for some systems only
    monkeypatch.chdir(tmp_path)
    shutil.copytree(ROOT / "configs", tmp_path / "configs")
    space: dict[str, Any] = {"__name__": "example"}
    for block in blocks(page):
        if block.order.startswith("file: "):
            (tmp_path / block.order.removeprefix("file: ")).write_text(block.text, encoding="utf-8")
        elif block.order.startswith("run") and block.language == "python":
            exec(compile(block.text, page, "exec"), space)
        elif block.order.startswith("run"):
            asked = re.fullmatch(r'run(?:: exit (\d+)(?: "(.*)")?)?', block.order)
            assert asked, f"{page}: '{block.order}'"
            lines = [line for line in block.text.splitlines() if line and not line.startswith("#")]
            ran = list(commands(block.text))
            assert len(ran) == len(lines), f"{page}: a runnable block holds mocca-robot commands only:\n{block.text}"
            for arguments in ran:
                status = main(arguments)
                said = capsys.readouterr()
                assert status == int(asked[1] or 0), f"{page}: {arguments}\n{said.out}{said.err}"
                assert (asked[2] or "") in said.out + said.err
    for file in tmp_path.rglob("*.json"):
        data = json.loads(file.read_text(encoding="utf-8"))
        if str(data.get("format", "")).startswith("mocca-robot/"):
            schema(data["format"].removeprefix("mocca-robot/")).validate(data)


@pytest.mark.parametrize("page", PAGES)
def test_every_example_is_run_or_says_why_not(page: str) -> None:
    for block in blocks(page):
        if block.language in EXECUTED:
            assert re.match(r"run\b|not run: \w", block.order), f"{page}: mark this block:\n{block.text}"
        if block.language in DATA:
            assert block.order.startswith("file: "), f"{page}: nothing uses this block:\n{block.text}"


@pytest.mark.parametrize("page", PAGES)
def test_commands_that_are_only_shown_exist_too(page: str) -> None:
    parser = build_parser()
    for block in blocks(page):
        for arguments in commands(block.text):
            parser.parse_args(arguments)


@pytest.mark.parametrize("name", list(GENERATE.pages()))
def test_generated_pages_are_up_to_date(name: str) -> None:
    content = GENERATE.pages()[name]
    assert (DOCS / name).read_text(encoding="utf-8") == content, "run: python docs/generate.py (or make docs)"


def test_every_command_is_documented() -> None:
    page = (DOCS / "cli.md").read_text(encoding="utf-8")
    for name, (line, parser) in GENERATE.commands().items():
        assert f"\n## {name}\n" in page
        assert line or parser.description, f"'{name}' has no help"
        for action in parser._actions:
            assert action.help or action.dest == "help" or hasattr(action, "add_parser"), f"{name}: {action.dest}"
            for option in action.option_strings:
                assert option in ("-h", "--help") or f"`{option}" in page, f"{name}: {option}"


def test_every_configuration_key_is_documented() -> None:
    page = (DOCS / "config.md").read_text(encoding="utf-8")
    for key in KEYS:
        assert key.description.endswith(".") and f"| `{key.name}` |" in page, key.name


def test_every_public_name_is_documented() -> None:
    page = (DOCS / "api.md").read_text(encoding="utf-8")
    for package, names in GENERATE.public_names().items():
        for name in names:
            assert re.search(rf"^### {name}$", page, re.MULTILINE), f"{package}.{name}"


def test_every_verdict_and_error_is_explained() -> None:
    page = (DOCS / "when-it-says-no.md").read_text(encoding="utf-8")
    headings = set(re.findall(r"^### (\w+)$", page, re.MULTILINE))
    sources = [*(ROOT / "mocca_robot" / "cli").glob("*.py")]
    made = re.compile(r'NegativeVerdict\(\s*(?:kind=)?"(\w+)"')
    kinds = {k for s in sources for k in made.findall(s.read_text(encoding="utf-8"))}
    assert NegativeVerdict.__doc__ is not None
    named = set(re.findall(r"'(\w+)'", NegativeVerdict.__doc__))
    errors = {
        MoccaError.__name__,
        *(c.__name__ for c in MoccaError.__subclasses__() if c.__module__.endswith(".errors")),
    }
    assert kinds and kinds | named | errors <= headings


@pytest.mark.parametrize("page", PAGES)
def test_code_that_a_page_names_exists(page: str) -> None:
    for dotted in set(re.findall(r"`((?:mocca_robot|planners|sim)(?:\.\w+)+)`", text(page))):
        value: Any = None
        for k in range(dotted.count(".") + 1, 0, -1):
            module = ".".join(dotted.split(".")[:k])
            try:
                value = importlib.import_module(module)
            except ModuleNotFoundError:
                continue
            for name in dotted.split(".")[k:]:
                value = getattr(value, name)
            break
        assert value is not None, dotted


@pytest.mark.parametrize("page", [*PAGES, "../README.md", "../CHANGELOG.md"])
def test_files_that_a_page_names_exist(page: str) -> None:
    for path in re.findall(r"`((?:mocca_robot|planners|sim|docs|tests|benchmarks|configs)/[\w/.]*)`", text(page)):
        assert (ROOT / path).exists(), path


def test_every_equation_of_the_article_has_its_row() -> None:
    page = text("architecture.md").partition("## Equation by equation")[2]
    rows = {int(number): where for number, where in re.findall(r"^\| (\d+) \|.*\| ([^|]+) \|$", page, re.MULTILINE)}
    assert sorted(rows) == list(range(1, 20))
    assert all("`mocca_robot." in w or "`planners." in w or w.startswith("not used: ") for w in rows.values())


def test_the_navigation_holds_every_page() -> None:
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    assert sorted(re.findall(r"[\w/-]+\.md", text.partition("\nnav:")[2])) == PAGES


def schema(name: str) -> Any:
    data = json.loads((DOCS / "schemas" / f"{name}.schema.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(data)
    return jsonschema.Draft202012Validator(data)


@pytest.mark.parametrize("path", CONFIGS, ids=lambda p: p.stem)
def test_configurations_and_their_assemblies_fit_their_schemas(path: Path, tmp_path: Path) -> None:
    schema("config").validate(yaml.safe_load(path.read_text(encoding="utf-8")))
    written = write_assembly(load(path).assembly, tmp_path / "assembly.json")
    schema("assembly").validate(json.loads(written.read_text(encoding="utf-8")))


@pytest.mark.parametrize(
    ("path", "name"),
    [
        *((p, "cell") for p in sorted((ROOT / "configs" / "cells").glob("*.yaml"))),
        *((p, "study-file") for p in sorted((ROOT / "configs" / "studies").glob("*.yaml"))),
    ],
    ids=lambda v: v.stem if isinstance(v, Path) else str(v),
)
def test_shipped_files_fit_their_schemas_and_a_misspelt_key_fits_none(path: Path, name: str) -> None:
    data = yaml.safe_load(path.read_text(encoding="utf-8"))
    schema(name).validate(data)
    for place in (data, *(v for v in data.values() if isinstance(v, dict) and v)):
        key = next(k for k in place if isinstance(place[k], list | dict | str | int | float))
        place[f"{key}x"] = place[key]
        assert list(schema(name).iter_errors(data)), f"{key}x"
        del place[f"{key}x"]
        if name == "study-file" and "generator.door_deg" in data.get("set", {}):
            break  # which keys a generator has, only it knows


@pytest.mark.parametrize("key", [k for k in CELL_KEYS if k.name.startswith("build.")], ids=lambda k: k.name)
def test_only_keys_of_a_cell_that_may_be_left_out_may_be_left_empty(key: Key, tmp_path: Path) -> None:
    data = yaml.safe_load((ROOT / "configs" / "cells" / "ur5e_2f85.yaml").read_text(encoding="utf-8"))
    name = key.name.removeprefix("build.")
    data["build"][name] = None
    path = tmp_path / "cell.yaml"
    path.write_text(yaml.safe_dump(data), encoding="utf-8")
    assert bool(list(schema("cell").iter_errors(data))) == key.required
    with pytest.raises(InputError, match=f"no '{name}'") if key.required else nullcontext():
        read_cell(path)


def test_all_keys_that_a_cell_lacks_are_named_at_once(tmp_path: Path) -> None:
    data = yaml.safe_load((ROOT / "configs" / "cells" / "ur5e_2f85.yaml").read_text(encoding="utf-8"))
    path = tmp_path / "cell.yaml"
    path.write_text(yaml.safe_dump({k: v for k, v in data.items() if k not in ("robot", "table_m")}), encoding="utf-8")
    with pytest.raises(InputError, match="no 'robot', 'table_m'"):
        read_cell(path)


def test_every_yaml_key_of_the_docs_is_in_its_table() -> None:
    for page, keys in (("cells.md", [*CELL_KEYS, *LIMIT_KEYS, *GRIPPER_KEYS["parallel"], *GRIPPER_KEYS["suction"]]),):
        text = (DOCS / page).read_text(encoding="utf-8")
        for key in keys:
            assert key.description.endswith(".") and f"| `{key.name}` |" in text, key.name
    studies = (DOCS / "studies.md").read_text(encoding="utf-8")
    for key in STUDY_KEYS:
        assert f"| `{key.name}` |" in studies, key.name


def test_designs_and_simulations_fit_their_schemas(tmp_path: Path) -> None:
    source = tmp_path / "first.json"
    source.write_text(next(b.text for b in blocks("index.md") if b.language == "json"), encoding="utf-8")
    assert main(["design", str(source), "-o", str(tmp_path / "out")]) == 0
    design = tmp_path / "out" / "design.json"
    schema("design").validate(json.loads(design.read_text(encoding="utf-8")))
    assert main(["simulate", str(design), "--states", "--tilt", "--insert", "--directions", "2"]) in (0, 1)
    schema("simulation").validate(json.loads(design.with_name("simulation.json").read_text(encoding="utf-8")))


def test_plans_fit_their_schema() -> None:
    data = document(small_plan(1))
    schema("plan").validate(json.loads(json.dumps(data)))
    data["steps"][0]["moves"][0]["kind"] = "throw"
    assert list(schema("plan").iter_errors(json.loads(json.dumps(data))))


@pytest.mark.parametrize("name", ["assembly", "design", "simulation", "plan"])
def test_schemas_refuse_another_format(name: str) -> None:
    assert list(schema(name).iter_errors({"format": "something/else", "version": 1}))


def test_the_citation_is_that_of_the_citation_file(capsys: pytest.CaptureFixture[str]) -> None:
    from mocca_robot.cli.cite import bibtex

    known = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    (article,) = known["references"]
    assert main(["cite"]) == 0
    said = capsys.readouterr().out
    assert bibtex("wang2021mocca") in said
    assert known["title"].partition(": ")[2] in said
    for value in (article["title"].partition(": ")[2], article["doi"], article["journal"], str(article["year"])):
        assert value in bibtex("wang2021mocca")
