"""Where physics and statics agree and where not: each kind once, in the words that report and command line both say."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mocca_robot.assembly import Assembly, Equilibrium, Goal, Interlocking, Mesh, Part, Polygon, SupportFree
from mocca_robot.motion.insertion import InsertionVerdict
from mocca_robot.statics.solution import Status
from mocca_robot.verdicts.agreement import Kind, Remark, agree, contradictions, gaps_rad, remarks, tilts_apart
from mocca_robot.verdicts.physics import (
    InsertionTrial,
    PartInsertion,
    Simulation,
    StateVerdict,
    TiltVerdict,
    Tries,
    Verdict,
)

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
HOLDS, SLIDES, UNSURE = Status.EQUILIBRIUM, Status.NOT_IN_EQUILIBRIUM, Status.INACCURATE
STANDS, FELL, FAILED = Verdict.STANDS, Verdict.FELL, Verdict.FAILED


def assembly(*goals: Goal) -> Assembly:
    shapes = [Polygon(SQUARE + np.array([0.0, height])) for height in range(3)]
    parts = tuple(Part(name, shape, fixed=name == "a") for name, shape in zip("abc", shapes))
    return Assembly("x", parts, goals or (Equilibrium(),))


def solid() -> Assembly:
    v = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    tetrahedron = Mesh(v, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]))
    return Assembly("y", (Part("a", tetrahedron, fixed=True),), (Equilibrium(),))


def state(placed: str, verdict: Verdict, statics: Status | None, **further: Any) -> StateVerdict:
    moved = (placed,) if verdict is FELL else ()
    return StateVerdict(placed=placed, verdict=verdict, statics=statics, moved=moved, **further)


def tilt(critical_deg: float, statics_deg: float, friction: float = 0.0, **further: Any) -> TiltVerdict:
    given = {"azimuth_rad": 0.0, "critical_rad": np.deg2rad(critical_deg), "statics_rad": np.deg2rad(statics_deg)}
    return TiltVerdict(**{**given, "friction": friction, **further})


def trial(kind: str, succeeded: bool, reason: str = "", below: str = "held") -> InsertionTrial:
    direction = (0.0, -1.0)
    return InsertionTrial(part="c", kind=kind, direction=direction, succeeded=succeeded, reason=reason, below=below)


def insertion(*trials: InsertionTrial) -> PartInsertion:
    return PartInsertion(part="c", axis=(0.0, -1.0), realised_rad=0.2, tried_rad=0.1, trials=trials)


def said(
    states: Iterable[StateVerdict] = (),
    tilts: Iterable[TiltVerdict] = (),
    insertions: Iterable[PartInsertion] = (),
    of: Assembly | None = None,
    engine: str = "mujoco 3.17.0",
) -> tuple[Remark, ...]:
    told = Simulation(name="x", engine=engine, states=tuple(states), tilt=tuple(tilts), insertion=tuple(insertions))
    return remarks(of or assembly(), told)


EARLY = replace(tilt(10.0, 12.0, 0.3), engine="coulomb 1")
EVERY_KIND = [
    (
        said([state("b", FELL, HOLDS, cause="soft contacts"), state("c", STANDS, HOLDS)]),
        Kind.DISAGREEMENT,
        True,
        "After placing 'b' it falls in MuJoCo and stands by statics; cause: soft contacts.",
    ),
    (
        said([state("b", STANDS, SLIDES)]),
        Kind.DISAGREEMENT,
        True,
        "After placing 'b' it stands in MuJoCo and falls by statics.",
    ),
    (
        said([state("b", STANDS, UNSURE)]),
        Kind.UNDECIDED,
        True,
        "After placing 'b' it stands in MuJoCo; statics gave no verdict.",
    ),
    (
        said([state("b", FAILED, HOLDS, reason="after 0.1 s: the clock stopped")]),
        Kind.INACCURATE,
        True,
        "MuJoCo gave no verdict after placing 'b': after 0.1 s: the clock stopped.",
    ),
    (
        said([state("c", FELL, SLIDES)]),
        Kind.FALLS,
        False,
        "Does not stand in MuJoCo after placing 'c': 'c' moved.",
    ),
    (
        said(tilts=[tilt(12.0, 10.0)]),
        Kind.DISAGREEMENT,
        True,
        "MuJoCo and statics disagree on the tilt towards the right (friction 0): 12.00° in MuJoCo, 10.00° by statics.",
    ),
    (
        said(tilts=[tilt(10.0, 12.0, azimuth_rad=np.pi / 4, cause="soft contacts")], of=solid()),
        Kind.DISAGREEMENT,
        True,
        "MuJoCo and statics disagree on the tilt towards 45° (friction 0): 10.00° in MuJoCo, 12.00° by statics; cause: "
        "soft contacts.",
    ),
    (
        said(tilts=[tilt(10.0, 12.0, 0.3, azimuth_rad=np.pi, failed=(0.2, 0.3))]),
        Kind.DISAGREEMENT,
        True,
        "2 of MuJoCo's runs gave no verdict at a tilt towards the left (friction 0.3): 10.00° in MuJoCo, 12.00° by "
        "statics.",
    ),
    (
        said(tilts=[EARLY]),
        Kind.DISAGREEMENT,
        True,
        "The friction engine and statics disagree on the tilt towards the right (friction 0.3): 10.00° in the friction "
        "engine, 12.00° by statics.",
    ),
    (
        said(tilts=[tilt(12.0, 10.0, 0.3, engine="springs 1.0")]),
        Kind.DISAGREEMENT,
        True,
        "Springs and statics disagree on the tilt towards the right (friction 0.3): 12.00° in springs, 10.00° by "
        "statics.",
    ),
    (
        said(insertions=[insertion(trial("axis", True), trial("rim", False, "jammed: 9 N"), trial("outside", False))]),
        Kind.JAMS,
        False,
        "'c' jams in 1 of 2 insertions inside its cone (jammed: 9 N).",
    ),
    (
        said(insertions=[insertion(trial("outside", True), trial("outside", False))]),
        Kind.DISAGREEMENT,
        True,
        "'c' goes in along 1 of 2 directions outside its cone, which geometry says are blocked.",
    ),
]


@pytest.mark.parametrize(("found", "kind", "contradicts", "text"), EVERY_KIND)
def test_each_kind_is_said_once_in_its_own_words(
    found: tuple[Remark, ...], kind: Kind, contradicts: bool, text: str
) -> None:
    mine = [r for r in found if r.kind is kind]
    assert [r.text for r in mine] == [text] and mine[0].contradicts is contradicts
    assert len(found) == len(mine) or kind is Kind.DISAGREEMENT


def test_every_kind_of_remark_is_tried() -> None:
    assert {kind for _, kind, _, _ in EVERY_KIND} == set(Kind)


@pytest.mark.parametrize("verdict", list(Verdict))
@pytest.mark.parametrize("statics", [*Status, None])
def test_states_agree_only_where_both_decide_alike(verdict: Verdict, statics: Status | None) -> None:
    same = {(STANDS, HOLDS), (FELL, SLIDES)}
    other = {(STANDS, SLIDES), (FELL, HOLDS)}
    assert agree(verdict, statics) is (
        True if (verdict, statics) in same else False if (verdict, statics) in other else None
    )


def test_what_agrees_is_passed_over() -> None:
    states = [state("b", STANDS, HOLDS), state("c", STANDS, HOLDS)]
    sound = insertion(trial("axis", True), trial("outside", False))
    assert said(states, [tilt(2.4, 2.5), tilt(13.0, 12.0, within_rad=np.deg2rad(0.6))], [sound]) == ()


def test_no_more_is_asked_of_a_tilt_than_its_bracket_tells() -> None:
    apart = tilt(12.0, 10.0, within_rad=np.deg2rad(1.6))
    assert not tilts_apart(apart, 2) and tilts_apart(replace(apart, within_rad=np.deg2rad(1.4)), 2)
    assert tilts_apart(tilt(11.0, 10.0), 2) and not tilts_apart(tilt(11.0, 10.0), 3)
    assert np.rad2deg(gaps_rad([apart])) == pytest.approx([3.6])


def test_falling_states_count_only_where_they_are_asked_for() -> None:
    early = [state("b", FELL, SLIDES), state("c", STANDS, HOLDS)]
    late = [state("b", STANDS, HOLDS), state("c", FELL, SLIDES)]
    assert said(early) == () and [r.kind for r in said(early, of=assembly(SupportFree()))] == [Kind.FALLS]
    assert [r.kind for r in said(late)] == [Kind.FALLS] and said(late, of=assembly(Interlocking("c"))) == ()


def test_a_jam_contradicts_geometry_only_where_it_says_that_the_part_goes_in() -> None:
    told = Simulation(name="x", engine="mujoco 3", insertion=(insertion(trial("rim", False)),))
    for alpha, contradicts in ((0.2, True), (-0.2, False)):
        geometry = InsertionVerdict("c", alpha, 0.1, (), False)
        assert geometry.assemblable is contradicts
        (jam,) = remarks(assembly(), told, insertions=[geometry])
        assert jam.kind is Kind.JAMS and jam.held and jam.contradicts is contradicts


def test_a_trial_onto_free_parts_that_fall_by_statics_says_nothing_of_the_joint() -> None:
    pushed = insertion(trial("axis", False, "pushed b away", below="free"))
    states = [state("b", STANDS, SLIDES), state("c", STANDS, HOLDS)]
    assert {r.kind for r in said(states, insertions=[pushed])} == {Kind.DISAGREEMENT}
    assert Kind.JAMS in {r.kind for r in said([state("b", STANDS, HOLDS)], insertions=[pushed])}
    held = insertion(trial("axis", False, "pushed b away"))
    assert Kind.JAMS in {r.kind for r in said(states, insertions=[held])}


def test_a_file_tells_contradictions_of_states_and_tilts_only() -> None:
    told = Simulation(
        name="x",
        engine="mujoco 3",
        states=(state("b", FELL, HOLDS), state("c", FELL, SLIDES)),
        tilt=(EARLY,),
        insertion=(insertion(trial("outside", True)),),
    )
    kinds = {r.text: r.kind for r in remarks(assembly(), told)}
    assert [kinds[text] for text in contradictions(assembly(), told)] == [Kind.DISAGREEMENT, Kind.DISAGREEMENT]


def test_counts_are_those_of_the_trials() -> None:
    trials = [replace(trial(k, k != "rim"), peak_force=f, allowed_force=4.0) for k, f in (("axis", 1.0), ("rim", 2.0))]
    entry = insertion(*trials, trial("outside", False))
    assert entry.inside == Tries(trials=2, succeeded=1, peak_force=2.0, force_share=0.5)
    assert entry.outside == Tries(trials=1, succeeded=0, peak_force=0.0, force_share=0.0)
