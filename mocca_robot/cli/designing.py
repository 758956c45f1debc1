"""The stage that designs joints: where it stands is kept, and Ctrl-C ends it with what was found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mocca_robot.assembly import Assembly
from mocca_robot.cli.console import Console
from mocca_robot.cli.exit_code import ExitCode
from mocca_robot.config.config import Config
from mocca_robot.contacts.contact import ContactReport
from mocca_robot.contacts.find import find_contacts
from mocca_robot.contacts.friction import Friction
from mocca_robot.errors import InputError
from mocca_robot.joints.options import JointOptions
from mocca_robot.report.case_words import case_words
from mocca_robot.tolerances import CASE_HELD

if TYPE_CHECKING:
    from planners.cone_joints.largest_tilt import LargestTilt
    from planners.cone_joints.outcome import Designed
    from planners.cone_joints.search import SearchState
    from planners.order.found_order import OrderedDesign

PROGRESS_FILE = "design-progress.json"
"""Beside the results: where an interrupted design stood."""


def design_joints(config: Config, contacts: ContactReport, folder: Path, console: Console) -> Designed:
    """Return the design run's outcome, with its two stages' wall times.

    With `joints.tilt_margin_deg: max` it is that of the largest reserve that is found. Otherwise it goes on where an
    earlier run of the same input into the same folder was interrupted. Where it stands is kept
    in `PROGRESS_FILE` until `forget_progress`.
    """
    from planners.cone_joints.checkpoint import Checkpoint, design_identity, read_checkpoint
    from planners.cone_joints.designer import contacts_left_planar, design
    from planners.cone_joints.largest_tilt import design_as_asked

    insertion = dict(config.insertion) or None
    for line in contacts_left_planar(config.assembly, contacts):
        console.warn(f"note: {line}")
    require_friction(config)
    if np.isinf(config.joints.tilt_margin_rad):
        with console.stage("climb") as show:
            return design_as_asked(
                config.assembly,
                config.joints,
                insertion=insertion,
                contacts=contacts,
                progress=lambda what, worst: show(f"{what}, E/|w|² {worst:.1e}"),
            )
    path = folder / PROGRESS_FILE
    identity = design_identity(config.assembly, config.joints, insertion)
    earlier = read_checkpoint(path, identity)
    if earlier.state is not None:
        console.say(f"going on from {path}: {state_words(earlier.state)}")
    elif earlier.why_not:
        console.warn(f"note: {path} is not gone on from, {earlier.why_not}; the design starts anew.")
    checkpoint = Checkpoint(path, identity)
    try:
        with console.stage("design") as show:
            result = design(
                config.assembly,
                config.joints,
                insertion=insertion,
                contacts=contacts,
                progress=lambda what, worst: show(f"{what}, E/|w|² {worst:.1e}"),
                resume=earlier.state,
                keep=checkpoint.keep,
            )
        if result.interrupted is not None:
            _say_kept(checkpoint.save(), console)
    except KeyboardInterrupt:
        _say_kept(checkpoint.save(), console)
        raise
    whole = console.seconds.pop("design")
    kinematic = float(result.design.seconds.get("kinematic", 0.0))
    console.seconds["kinematic design"] = kinematic
    console.seconds["realization"] = max(whole - kinematic, 0.0)
    return result


def design_in_order(config: Config, contacts: ContactReport, folder: Path, console: Console) -> OrderedDesign:
    """Return the design run's outcome in the order of the configuration or, with `sequence: auto`, in one found for it.

    Says what was found. Without any order there is no design.
    """
    from mocca_robot.contacts.find import find_contacts
    from planners.order.found_order import OrderedDesign, design_in_found_order

    if not config.finds_order:
        designed = design_joints(config, contacts, folder, console)
        return OrderedDesign(assembly=config.assembly, designed=designed, sequence=None, tried=1)

    def joined(assembly: Assembly) -> Designed:
        console.say(f"order: {', '.join(p.name for p in assembly.parts if not p.fixed)}")
        return design_joints(replace(config, assembly=assembly), find_contacts(assembly), folder, console)

    found = design_in_found_order(
        config.assembly,
        joined,
        contacts=contacts,
        friction=float(config.friction),
        watch=lambda: console.stage("sequence"),
    )
    for line in sequence_words(found):
        console.say(line)
    return found


def sequence_words(found: OrderedDesign) -> list[str]:
    """Return how an order was found, or why none was, for people."""
    from mocca_robot.cli.sequence import lines

    assert found.sequence is not None
    told = lines(found.sequence)
    if found.designed is None:
        return told
    orders = "1 order was" if found.tried == 1 else f"{found.tried} orders were"
    end = "" if found.designed.achieved else "; none has joints, and this is the first"
    return [*told, f"{orders} tried for joints{end}"]


def strengthen_joints(config: Config, found: Designed, console: Console) -> Designed:
    """Return a design whose joints bear their loads as often as `strength` asks, or the strongest that was found."""
    from planners.cone_joints.designer import design
    from planners.cone_joints.stronger import reached, stronger

    if not config.asks_strength or found.interrupted is not None or not found.achieved:
        return found
    contacts, friction = find_contacts(config.assembly), found.design.judged_friction
    with console.stage("strength of joints") as show:

        def again(options: JointOptions) -> Designed:
            show(f"joints of at most {options.max_height:.2g} of their contact")
            return design(config.assembly, options, insertion=dict(config.insertion) or None, contacts=contacts)

        return stronger(
            found, config.joints, config.strength.safety, again, lambda d: reached(d, config.strength, friction)
        )


def require_friction(config: Config) -> None:
    """Raise InputError where joints count on more friction than the parts are said to have."""
    told = config.friction
    least = min((mu for _, mu in told.table), default=float(told)) if isinstance(told, Friction) else told
    if config.joints.friction > least:
        raise InputError(
            f"joints.friction is {config.joints.friction:g}, but friction says that it may be only {least:g}; "
            f"write joints: {{friction: {least:g}}}."
        )


def find_largest_tilt(config: Config, contacts: ContactReport, console: Console) -> LargestTilt:
    """Return the design at the largest tilt that is found, and what is known beyond it."""
    from planners.cone_joints.largest_tilt import largest_tilt

    require_friction(config)
    with console.stage("climb") as show:
        return largest_tilt(
            config.assembly,
            config.joints,
            insertion=dict(config.insertion) or None,
            contacts=contacts,
            progress=lambda what, worst: show(f"{what}, E/|w|² {worst:.1e}"),
        )


def _say_kept(path: Path | None, console: Console) -> None:
    if path is not None:
        console.warn(f"Interrupted; {path} keeps where the design stands: the same command goes on from there.")


def state_words(state: SearchState) -> str:
    """Return where a search stood, in words."""
    if state.stage == "finished":
        return "its joints were found already"
    if state.stage == "thinning":
        return "joints that hold were found; making some of them planar again"
    return f"attempt {state.attempt + 1}, step {1 if state.polishing is None else state.polishing.steps + 1}"


def tell_no_order(found: OrderedDesign, console: Console) -> int:
    """Return the exit status where there is no order of assembly, after giving the evidence to programs."""
    from mocca_robot.cli.sequence import document

    assert found.sequence is not None
    console.say(console.times())
    return console.finish(ExitCode.NEGATIVE, {"name": found.assembly.name, "sequence": document(found.sequence)})


def tell_interruption(result: Designed, files: Mapping[str, Path], folder: Path, console: Console) -> int:
    """Return the exit status of a design that Ctrl-C cut short, after saying what is kept and how to go on."""
    worst = max(result.design.load_cases, key=lambda c: c.infeasibility_after)
    curved = sum(not j.is_planar for j in result.design.joints)
    holds = "every load case holds, with more curved joints than may be needed"
    short = f"E/|w|² is still {worst.infeasibility_after:.2g} ({case_words(worst.name)})"
    if worst.infeasibility_after <= CASE_HELD:
        short = "every load case holds, but not yet with the insertion cones and the room that joints must keep"
    console.say(f"Interrupted during '{result.interrupted}': {holds if result.achieved else short}.")
    console.say(f"{files['design']} holds the {curved} curved joints as far as they were found; nothing was verified.")
    progress = folder / PROGRESS_FILE
    kept = {**files, "progress": progress} if progress.exists() else dict(files)
    console.say(console.times())
    document = {
        "interrupted": True,
        "name": result.design.source.name,
        "curved_joints": curved,
        "achieved": result.achieved,
        "cases": [asdict(case) for case in result.design.load_cases],
        "files": {kind: str(path) for kind, path in kept.items()},
    }
    return console.finish(ExitCode.INTERRUPTED, document)


def forget_progress(folder: Path) -> None:
    """Forget where a design stood: it has been judged, and simulated if it was asked for."""
    (folder / PROGRESS_FILE).unlink(missing_ok=True)
