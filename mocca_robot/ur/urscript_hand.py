"""What a URScript program does with the hand: fingers, a vacuum cup, or a person who attaches every part."""

from __future__ import annotations

from mocca_robot.plan.plan import Move, MoveKind, Plan, Step
from mocca_robot.plan.wiring import VacuumWiring, bank_and_number
from mocca_robot.ur.grippers import ROBOTIQ, RobotiqSocket
from mocca_robot.ur.suction import FLICKER_S
from mocca_robot.ur.urscript_text import number, numbers, plain


def finger_helpers() -> list[str]:
    """Return functions that move a Robotiq gripper and wait for it."""
    return [
        f'  if not socket_open("127.0.0.1", {RobotiqSocket.PORT}, "gripper"):',
        '    fail("The gripper does not answer. Install and activate its URCap.")',
        "  end",
        "  def order(name, value):",
        '    socket_set_var(name, value, "gripper")',
        # Unread, the acknowledgement would be taken for the answer to the next question.
        '    ack = socket_read_byte_list(3, "gripper")',
        "    if ack[0] != 3 or ack[1] != 97 or ack[2] != 99 or ack[3] != 107:",
        '      fail("The gripper does not acknowledge.")',
        "    end",
        "  end",
        "  def grip(position, force_byte):",
        '    order("SPE", 64)',
        '    order("FOR", force_byte)',
        '    order("POS", position)',
        '    order("GTO", 1)',
        "    sleep(0.3)",
        "    t = 0.0",
        '    while socket_get_var("OBJ", "gripper") == 0 and t < 4.0:',
        "      sleep(0.05)",
        "      t = t + 0.05",
        "    end",
        '    return socket_get_var("POS", "gripper")',
        "  end",
    ]


def vacuum_helpers(wiring: VacuumWiring) -> list[str]:
    """Return functions that switch the cup; whatever halts the program leaves its output as it is."""
    bank, pin = bank_and_number(wiring.output)
    valve = f"get_{bank}_digital_out({pin})"
    out = [
        "  global carrying = False",
        "  def suck(on):",
        "    carrying = False",
        f"    set_{bank}_digital_out({pin}, on)",
    ]
    if wiring.input is None:
        out += [f"    sleep({number(wiring.wait_s)})", "    carrying = on", "    return on"]
    else:
        inputs, place = bank_and_number(wiring.input)
        switch = f"get_{inputs}_digital_in({place})"
        out += [
            "    t = 0.0",
            f"    while {switch} != on and t < {number(wiring.wait_s)}:",
            "      sleep(0.02)",
            "      t = t + 0.02",
            "    end",
            f"    carrying = on and {switch}",
            f"    return {switch}",
            "  end",
            "  thread part_guard():",
            "    gone = 0.0",
            "    while True:",
            f"      if carrying and not {switch}:",
            "        gone = gone + get_steptime()",
            f"        if gone > {number(FLICKER_S)}:",
            '          textmsg("the part was lost: no vacuum under the cup")',
            "          halt",
            "        end",
            "      else:",
            "        gone = 0.0",
            "      end",
            "      sync()",
            "    end",
        ]
    return [
        *out,
        "  end",
        f"  if {valve}:",
        '    fail("The vacuum is on. Take hold of the part on the cup, switch the output off, then start again.")',
        "  end",
    ]


def _suck(plan: Plan, step: Step, picks: bool) -> list[str]:
    if not picks:
        # A part that fell off in the seat's last moment was not placed: the guard needs its time to see that.
        return [
            f"  sleep({number(2.0 * FLICKER_S)})",
            "  if suck(False):",
            f'    fail("The cup does not let part {plain(step.part)} go.")',
            "  end",
        ]
    return [
        "  if not suck(True):",
        f'    fail("Part {plain(step.part)} is not on the cup: no vacuum.")',
        "  end",
    ]


def open_hand(plan: Plan, opening_m: float) -> list[str]:
    """Return what opens the empty hand as far as the coming move was planned with, and sees that it is so."""
    if plan.gripper not in ROBOTIQ:
        return []  # a cup is off: the program looks at it when it begins and after every release
    position = _position(plan, opening_m)
    slack = max(1, round(255 * plan.cell.limits.grip_tolerance_m / ROBOTIQ[plan.gripper].STROKE_M))
    return [
        f"  reached = grip({position}, 0)",
        f"  if reached > {position + slack} or reached < {position - slack}:",
        '    fail("The fingers are not as open as they were told to be.")',
        "  end",
    ]


def _position(plan: Plan, opening_m: float) -> int:
    return round(255 * (1.0 - min(max(opening_m / ROBOTIQ[plan.gripper].STROKE_M, 0.0), 1.0)))


def grip(plan: Plan, step: Step, move: Move) -> list[str]:
    """Return what takes hold of a part, or lets it go, with the payload that goes with it."""
    picks = move.kind is MoveKind.PICK
    mass, cog = plan.cell.payload(step.grasp if picks else None)
    payload = f"  set_payload({number(mass)}, {numbers(cog)})"
    if plan.gripper == "none":
        word = "Attach" if picks else "Detach"
        return [f'  popup("{word} part {plain(step.part)}.", title="mocca-robot", blocking=True)', payload]
    if plan.gripper == "suction":
        return [*_suck(plan, step, picks), payload]
    fingers = ROBOTIQ[plan.gripper]
    stroke, (low, high) = fingers.STROKE_M, fingers.FORCE_N
    position = _position(plan, move.gripper_m)
    force = round(255 * min(max((step.grasp.force_n - low) / (high - low), 0.0), 1.0))
    out = [f"  reached = grip({position}, {force})"]
    if picks:
        wanted = round(255 * (1.0 - step.grasp.width_m / stroke))
        slack = max(1, round(255 * plan.cell.limits.grip_tolerance_m / stroke))
        out += [
            # OBJ 2: something stopped the fingers while they closed.
            '  stopped = socket_get_var("OBJ", "gripper")',
            f"  if reached > {wanted + slack} or reached < {wanted - slack} or stopped != 2:",
            f'    fail("Part {plain(step.part)} is not between the fingers.")',
            "  end",
        ]
    return [*out, payload]
