"""A plan as one URScript program, for a controller that is loaded from a file instead of steered over RTDE.

What is lost against `execute`: no journal, no resume, no retries elsewhere in the cone, no supervision from outside,
no averaged bias, no fit to the arm's calibration. What remains: a force guard, compliant insertion by depth, with the
executor's limits on jams, stalls, sideways and back travel and tilt, openings and widths read back, and a halt with a
message to the operator on anything unexpected. Unproven on hardware.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.errors import InputError
from mocca_robot.plan.gripper import require_drivable
from mocca_robot.plan.guards import (
    BEYOND_M,
    LATERAL_M,
    PUSH_GRACE_S,
    RESISTS,
    SEATED_SHARE,
    SEATING_M,
    SEATING_PACE,
    STALL_S,
)
from mocca_robot.plan.hand import hands, to_open
from mocca_robot.plan.limits import MotionLimits
from mocca_robot.plan.plan import Move, MoveKind, Plan, Step, Waypoint, insertion_axis
from mocca_robot.plan.pose import distance_m
from mocca_robot.plan.push_frame import frame_along
from mocca_robot.plan.safety import require_sound
from mocca_robot.plan.wiring import VacuumWiring, bank_and_number
from mocca_robot.ur.grippers import ROBOTIQ, RobotiqSocket
from mocca_robot.ur.suction import FLICKER_S

BLEND_M = 0.002
GUARD_CYCLES = 20
"""Of 2 ms: a force above the limit that lasts for less is noise."""
LARGEST = 1000.0
"""No figure of a checked plan is larger; anything else is a unit mistake."""

_HELPERS = """\
  global guard_n = 0.0
  global watching = False
  def fail(message):
    popup(message, title="mocca-robot", error=True, blocking=True)
    halt
  end
  thread force_guard():
    over = 0
    while True:
      if watching and force() > guard_n:
        over = over + 1
        if over >= @LASTS@:
          watching = False
          textmsg("force limit exceeded, newtons: ", guard_n)
          halt
        end
      else:
        over = 0
      end
      sync()
    end
  end
  def zero():
    watching = False
    sleep(0.2)
    zero_ftsensor()
    sleep(0.1)
  end
  def along(start, axis):
    now = get_actual_tcp_pose()
    return (now[0] - start[0]) * axis[0] + (now[1] - start[1]) * axis[1] + (now[2] - start[2]) * axis[2]
  end
  def aside(start, axis):
    now = get_actual_tcp_pose()
    deep = along(start, axis)
    x = now[0] - start[0] - deep * axis[0]
    y = now[1] - start[1] - deep * axis[1]
    z = now[2] - start[2] - deep * axis[2]
    return sqrt(x * x + y * y + z * z)
  end
  def tilted(planned):
    turn = pose_trans(pose_inv(planned), get_actual_tcp_pose())
    return sqrt(turn[3] * turn[3] + turn[4] * turn[4] + turn[5] * turn[5])
  end
  def pressed(axis):
    felt = get_tcp_force()
    return norm(felt[0] * axis[0] + felt[1] * axis[1] + felt[2] * axis[2])
  end
  def push_at(frame, push, speed):
    caps = [speed, speed, speed, @TILT@, @TILT@, @TILT@]
    force_mode(frame, [1, 1, 1, 0, 0, 0], [0.0, 0.0, push, 0.0, 0.0, 0.0], 2, caps)
  end
  def insert(turn, planned, axis, depth, tolerance, push, speed, limit_n, hard_n, jam_s, slow):
    now = get_actual_tcp_pose()
    frame = p[now[0], now[1], now[2], turn[0], turn[1], turn[2]]
    guard_n = limit_n
    watching = True
    force_mode_set_damping(@DAMPING@)
    force_mode_set_gain_scaling(@GAIN@)
    push_at(frame, push, speed)
    t = 0.0
    hard_t = 0.0
    hard_depth = 0.0
    stall_t = 0.0
    stall_depth = along(planned, axis)
    pressing = False
    done = False
    slowed = False
    wrong = ""
    while not done and wrong == "":
      sync()
      t = t + get_steptime()
      deep = along(planned, axis)
      if not slowed and deep >= depth - @SEATING@:
        slowed = True
        push_at(frame, push, @PACE@ * speed)
      end
      if deep < -@BEYOND@ or deep > depth + @BEYOND@:
        wrong = "The part is not where it was thought to be."
      elif aside(planned, axis) > @LATERAL@:
        wrong = "The part went sideways."
      elif tilted(planned) > @TILT@:
        wrong = "The part tilted."
      elif deep >= depth:
        done = True
      elif deep >= depth - tolerance and pressed(axis) >= @SEATED@ * push:
        done = True
      end
      if pressed(axis) < hard_n or not pressing or deep - hard_depth >= slow * (t - hard_t) + 0.0001:
        pressing = pressed(axis) >= hard_n
        hard_t = t
        hard_depth = deep
      elif t > @GRACE@ and t - hard_t >= jam_s:
        wrong = "The part jammed."
      end
      if t - stall_t >= @STALL@:
        if deep - stall_depth < slow * @STALL@ and not done and wrong == "":
          wrong = "The part jammed."
        end
        stall_t = t
        stall_depth = deep
      end
    end
    end_force_mode()
    stopl(2.0)
    watching = False
    if wrong == "" and along(planned, axis) < depth - tolerance:
      wrong = "The part did not reach its depth."
    elif wrong == "" and aside(planned, axis) > @ASIDE@:
      wrong = "The part is in, but beside its place."
    elif wrong == "" and tilted(planned) > @ASLANT@:
      wrong = "The part is in, but tilted."
    end
    if wrong != "":
      textmsg(wrong)
      fail("The insertion failed, see the log. Clear the cell before anything else.")
    end
  end
"""


def urscript(plan: Plan) -> str:
    """Return the program; InputError when the plan is not sound (`safety.require_sound`) or a number is not usable."""
    require_sound(plan)
    require_drivable(plan)
    cell = plan.cell
    first = plan.first_waypoint
    out = [
        "def mocca_build():",
        f"  # plan {plan.sha256[:16]}: {plan.robot}, {len(plan.steps)} parts, cell {_plain(cell.name)}",
        "  # generated; unproven on hardware: run at reduced speed first, with a hand on the emergency stop",
        *_helpers(cell.limits).splitlines(),
        f"  set_tcp({_pose(cell.tcp_offset)})",
        f"  set_payload({_number(cell.tool_mass_kg)}, {_list(cell.tool_cog_m)})",
    ]
    if plan.gripper in ROBOTIQ:
        out += _gripper_helpers()
    if plan.cell.vacuum is not None and plan.gripper == "suction":
        out += _vacuum_helpers(plan.cell.vacuum)
    out += [
        f"  goal = {_list(first.q)}",
        "  here = get_actual_joint_positions()",
        "  j = 0",
        "  while j < 6:",
        f"    if norm(here[j] - goal[j]) > {_number(cell.limits.start_joint_rad)}:",
        '      fail("The arm does not stand at the first waypoint. Move it there, then start again.")',
        "    end",
        "    j = j + 1",
        "  end",
        f'  popup("{len(plan.steps)} parts will be built. Keep clear of the arm.", title="mocca-robot", blocking=True)',
        "  guard = run force_guard()",
    ]
    if plan.cell.vacuum is not None and plan.cell.vacuum.input and plan.gripper == "suction":
        out.append("  keeper = run part_guard()")
    for i, step in enumerate(plan.steps):
        out.append(f'  textmsg("step {i}: {_plain(step.part)}")')
        opened: float | None = None
        for hand, move in zip(hands(step), step.moves, strict=False):
            out.append(f"  # {move.kind}")
            if to_open(hand, move, opened):
                out += _open(plan, move.gripper_m)
                opened = move.gripper_m
            out += _move(plan, step, move)
    out += ["  watching = False", f'  popup("{len(plan.steps)} parts are placed.", title="mocca-robot")', "end", ""]
    return "\n".join(out)


def _helpers(limits: MotionLimits) -> str:
    out = _HELPERS
    for name, value in (
        ("TILT", limits.abort_tilt_rad),
        ("SEATED", SEATED_SHARE),
        ("SEATING", SEATING_M),
        ("PACE", SEATING_PACE),
        ("BEYOND", BEYOND_M),
        ("LATERAL", LATERAL_M),
        ("GRACE", PUSH_GRACE_S),
        ("STALL", STALL_S),
        ("DAMPING", limits.force_damping),
        ("GAIN", limits.force_gain),
        ("ASIDE", limits.sideways_tolerance_m),
        ("ASLANT", limits.tilt_tolerance_rad),
    ):
        out = out.replace(f"@{name}@", _number(value))
    return out.replace("@LASTS@", str(GUARD_CYCLES))


def _move(plan: Plan, step: Step, move: Move) -> list[str]:
    limits = plan.cell.limits
    if move.kind is MoveKind.INSERT:
        return ["  zero()", _insert(move, limits)]
    out = []
    if len(move.path) > 1:
        if move.kind in (MoveKind.TRANSIT, MoveKind.APPROACH, MoveKind.PICK):
            out.append("  zero()")
        contact = move.kind in (MoveKind.APPROACH, MoveKind.PICK)
        guard = min(limits.contact_force_n, move.force_limit_n) if contact else move.force_limit_n
        out += [f"  guard_n = {_number(guard)}", "  watching = True"]
        if move.kind is MoveKind.TRANSIT:
            out += _joint_path(move.path, limits)
        else:
            acceleration = limits.transfer_acceleration_m_s2
            out.append(f"  movel({_list(move.path[-1].q)}, a={_number(acceleration)}, v={_number(move.speed_m_s)})")
        out.append("  watching = False")
    if move.kind in (MoveKind.PICK, MoveKind.RELEASE):
        out += _grip(plan, step, move)
    return out


def _joint_path(path: Sequence[Waypoint], limits: MotionLimits) -> list[str]:
    """Return blended joint moves whose leading joint has the planned speed of each segment."""
    out = []
    for w in range(1, len(path)):
        a, b = path[w - 1], path[w]
        rate = float(np.abs(np.subtract(b.q, a.q)).max()) / (b.t - a.t)
        length = distance_m(a.tcp, b.tcp)
        following = distance_m(b.tcp, path[w + 1].tcp) if w + 1 < len(path) else 0.0
        blend = min(BLEND_M, 0.4 * min(length, following))
        speed = min(max(rate, 1e-3), limits.joint_speed_rad_s)
        a_max = _number(limits.joint_acceleration_rad_s2)
        out.append(f"  movej({_list(b.q)}, a={a_max}, v={_number(speed)}, r={_number(blend)})")
    return out


def _insert(move: Move, limits: MotionLimits) -> str:
    axis, depth = insertion_axis(move.path)
    rotation = frame_along(axis, move.path[0].tcp)[3:]
    numbers = (
        depth,
        limits.depth_tolerance_m,
        limits.push_force_n,
        limits.insert_speed_m_s,
        move.force_limit_n,
        min(limits.jam_force_n, RESISTS * limits.push_force_n),
        limits.jam_time_s,
        min(limits.jam_speed_m_s, 0.5 * SEATING_PACE * limits.insert_speed_m_s),
    )
    planned = _pose(move.path[0].tcp)
    return f"  insert({_list(rotation)}, {planned}, {_list(axis)}, {', '.join(_number(n) for n in numbers)})"


def _gripper_helpers() -> list[str]:
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


def _vacuum_helpers(wiring: VacuumWiring) -> list[str]:
    """Return functions that switch the cup; whatever halts the program leaves its output as it is."""
    bank, number = bank_and_number(wiring.output)
    valve = f"get_{bank}_digital_out({number})"
    out = [
        "  global carrying = False",
        "  def suck(on):",
        "    carrying = False",
        f"    set_{bank}_digital_out({number}, on)",
    ]
    if wiring.input is None:
        out += [f"    sleep({_number(wiring.wait_s)})", "    carrying = on", "    return on"]
    else:
        inputs, place = bank_and_number(wiring.input)
        switch = f"get_{inputs}_digital_in({place})"
        out += [
            "    t = 0.0",
            f"    while {switch} != on and t < {_number(wiring.wait_s)}:",
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
            f"        if gone > {_number(FLICKER_S)}:",
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
            f"  sleep({_number(2.0 * FLICKER_S)})",
            "  if suck(False):",
            f'    fail("The cup does not let part {_plain(step.part)} go.")',
            "  end",
        ]
    return [
        "  if not suck(True):",
        f'    fail("Part {_plain(step.part)} is not on the cup: no vacuum.")',
        "  end",
    ]


def _open(plan: Plan, opening_m: float) -> list[str]:
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


def _grip(plan: Plan, step: Step, move: Move) -> list[str]:
    cell, grasp = plan.cell, step.grasp
    picks = move.kind is MoveKind.PICK
    carried = cell.tool_mass_kg + (grasp.mass_kg if picks else 0.0)
    both = zip(cell.tool_cog_m, grasp.cog_m, strict=True)
    cog = [(cell.tool_mass_kg * a + grasp.mass_kg * b) / max(carried, 1e-9) if picks else a for a, b in both]
    payload = f"  set_payload({_number(carried)}, {_list(cog)})"
    if plan.gripper == "none":
        word = "Attach" if picks else "Detach"
        return [f'  popup("{word} part {_plain(step.part)}.", title="mocca-robot", blocking=True)', payload]
    if plan.gripper == "suction":
        return [*_suck(plan, step, picks), payload]
    fingers = ROBOTIQ[plan.gripper]
    stroke, (low, high) = fingers.STROKE_M, fingers.FORCE_N
    position = _position(plan, move.gripper_m)
    force = round(255 * min(max((grasp.force_n - low) / (high - low), 0.0), 1.0))
    out = [f"  reached = grip({position}, {force})"]
    if picks:
        wanted = round(255 * (1.0 - grasp.width_m / stroke))
        slack = max(1, round(255 * cell.limits.grip_tolerance_m / stroke))
        out += [
            # OBJ 2: something stopped the fingers while they closed.
            '  stopped = socket_get_var("OBJ", "gripper")',
            f"  if reached > {wanted + slack} or reached < {wanted - slack} or stopped != 2:",
            f'    fail("Part {_plain(step.part)} is not between the fingers.")',
            "  end",
        ]
    return [*out, payload]


def _number(value: float) -> str:
    """Return a number as URScript reads it; InputError unless it is finite and of sensible size."""
    if not math.isfinite(value) or abs(value) > LARGEST:
        raise InputError(f"The number {value!r} cannot go into a robot program; limit ±{LARGEST:g}. Plan again.")
    return f"{value:.6f}"


def _list(values: Sequence[float] | Array) -> str:
    return "[" + ", ".join(_number(float(v)) for v in values) + "]"


def _pose(values: Sequence[float]) -> str:
    return "p" + _list(values)


def _plain(text: str) -> str:
    """Return a name without anything that could end a string or a line of the program."""
    return "".join(c if (c.isascii() and c.isalnum()) or c in " _-." else "_" for c in text)[:60]
