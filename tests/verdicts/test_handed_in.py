"""`verify` takes whatever holds parts, with what belongs to it, and names the type of what does not."""

from dataclasses import replace
from pathlib import Path

import pytest

from mocca_robot import InputError, Verification, load, read_design, verify, write_design
from mocca_robot.config.examples import examples_folder
from mocca_robot.design import CountedFriction
from mocca_robot.motion.parts_graph import PartsGraph
from planners import design


def seen(found: Verification) -> list[object]:
    cases = [(c.case.name, c.result.status) for c in found.cases]
    return [*cases, *((i.part, pytest.approx(i.alpha_rad, abs=1e-9), i.assemblable) for i in found.insertions)]


def test_every_form_of_a_design_gets_the_verdict_of_its_parts(tmp_path: Path) -> None:
    config = load(examples_folder() / "stack.yaml")
    outcome = design(config.assembly)
    built = outcome.design
    ways = {i.part: i.direction for i in built.insertion}
    wanted = seen(verify(built.assembly, directions=ways))
    stored = read_design(write_design(built, tmp_path))
    graph = PartsGraph.of(built.assembly, insertion=ways)
    for what in (outcome, built, stored, graph):
        assert seen(verify(what)) == wanted and verify(what).stands
    for what in (config, config.assembly, PartsGraph.of(config.assembly)):
        assert not verify(what).stands
    counting = replace(built, source=config.assembly, assembly=config.assembly, friction=CountedFriction(1.0, 0.8))
    assert verify(counting).stands and not verify(counting, friction=0.0).stands


def test_what_holds_no_parts_is_named_with_a_remedy() -> None:
    config = load(examples_folder() / "stack.yaml")
    part = config.assembly.parts[0]
    for wrong, words in (
        ("tower.yaml", r"str 'tower\.yaml'.*verify\(load\('tower\.yaml'\)\)"),
        (Path("tower.yaml"), r"Path.*verify\(load\("),
        ([part], r"list.*Assembly\('name', \(part, …\)\)"),
        (part, r"Part.*Assembly\("),
        (None, "None.*Hand in an Assembly"),
        (verify(config), "type Verification.*Hand in an Assembly"),
    ):
        with pytest.raises(InputError, match=words):
            verify(wrong)  # type: ignore[arg-type]
    graph = PartsGraph.of(config.assembly)
    state = next(iter(graph.states.values()))
    assert not state.present.all()
    with pytest.raises(InputError, match=r"lacks '.*Hand in the whole graph"):
        verify(state)
