"""The fake controller's RTDE server (port 30004, protocol version 2).

Messages are a big-endian header `>HB` (size with header, type) and a body. Types: V negotiate, v version, O outputs,
I inputs, S start, P pause, U data.
"""

from __future__ import annotations

import asyncio
import contextlib
import struct
from collections.abc import Callable

from mocca_robot.ur.fake.arm import NORMAL, PLAYING, PROTECTIVE, ROBOT_EMERGENCY, SAFEGUARD, FakeArm
from mocca_robot.ur.fake.world import Fault

VERSION = (5, 11, 0, 0)
_HEADER = struct.Struct(">HB")
_FORMATS = {
    "DOUBLE": "d",
    "VECTOR6D": "6d",
    "VECTOR3D": "3d",
    "INT32": "i",
    "UINT32": "I",
    "UINT64": "Q",
    "VECTOR6INT32": "6i",
    "BOOL": "?",
    "UINT8": "B",
}
_OUTPUT_BANKS = {
    "standard_digital_output": (0, 8),
    "configurable_digital_output": (8, 8),
    "tool_digital_output": (16, 2),
}
"""First bit and count of each bank of digital outputs."""
_IGNORED = {
    "speed_slider_mask": "UINT32",
    "speed_slider_fraction": "DOUBLE",
    "standard_analog_output_mask": "UINT8",
    "standard_analog_output_type": "UINT8",
    "standard_analog_output_0": "DOUBLE",
    "standard_analog_output_1": "DOUBLE",
}
"""Inputs that a client may announce and that change nothing here."""
Value = list[float] | list[int] | float | int


def _outputs(arm: FakeArm) -> dict[str, tuple[str, Callable[[], Value]]]:
    """Return every output this controller has: its type and how to read it."""
    stale = Fault.STALE
    frozen = {"time": 0.0}

    def timestamp() -> float:
        if stale not in arm.world.active:
            frozen["time"] = arm.time_s
        return frozen["time"]

    def actual_q() -> list[float]:
        out = [float(v) for v in arm.q]
        if Fault.NAN in arm.world.active:
            out[0] = float("nan")
        return out

    def safety_bits() -> int:
        bit = {NORMAL: 0, PROTECTIVE: 2, SAFEGUARD: 4, ROBOT_EMERGENCY: 6}[arm.safety_mode]
        return 1 << bit | (1 << 7 if arm.safety_mode == ROBOT_EMERGENCY else 0)

    zeros: Callable[[], Value] = lambda: [0.0] * 6  # noqa: E731
    nothing: Callable[[], Value] = lambda: 0.0  # noqa: E731
    out: dict[str, tuple[str, Callable[[], Value]]] = {
        "timestamp": ("DOUBLE", timestamp),
        "actual_q": ("VECTOR6D", actual_q),
        "target_q": ("VECTOR6D", lambda: [float(v) for v in arm.q]),
        "actual_qd": ("VECTOR6D", lambda: [float(v) for v in arm.qd]),
        "target_qd": ("VECTOR6D", lambda: [float(v) for v in arm.qd]),
        "actual_TCP_pose": ("VECTOR6D", arm.tcp_pose),
        "target_TCP_pose": ("VECTOR6D", arm.tcp_pose),
        "actual_TCP_speed": ("VECTOR6D", arm.tcp_speed),
        "target_TCP_speed": ("VECTOR6D", arm.tcp_speed),
        "actual_TCP_force": ("VECTOR6D", lambda: [float(v) for v in arm.force]),
        "ft_raw_wrench": ("VECTOR6D", lambda: [float(v) for v in arm.force]),
        "robot_mode": ("INT32", lambda: arm.robot_mode),
        "safety_mode": ("INT32", lambda: arm.safety_mode),
        "speed_scaling": ("DOUBLE", lambda: 1.0),
        "target_speed_fraction": ("DOUBLE", lambda: arm.slider),
        "runtime_state": ("UINT32", lambda: arm.runtime_state),
        "robot_status_bits": ("UINT32", lambda: 1 | (2 if arm.runtime_state == PLAYING else 0)),
        "safety_status_bits": ("UINT32", safety_bits),
        "payload": ("DOUBLE", lambda: arm.payload_kg),
        "payload_cog": ("VECTOR3D", lambda: [float(v) for v in arm.payload_cog]),
        "payload_inertia": ("VECTOR6D", zeros),
        "joint_mode": ("VECTOR6INT32", lambda: [255] * 6),
        "actual_tool_accelerometer": ("VECTOR3D", lambda: [0.0, 0.0, 9.81]),
        "actual_digital_input_bits": ("UINT64", lambda: arm.digital_inputs),
        "actual_digital_output_bits": ("UINT64", lambda: arm.digital_outputs),
    }
    for name in ("target_qdd", "target_current", "target_moment", "actual_current", "joint_control_output"):
        out[name] = ("VECTOR6D", zeros)
    for name in ("joint_temperatures", "actual_joint_voltage"):
        out[name] = ("VECTOR6D", zeros)
    for name in ("execution_time", "momentum", "main_voltage", "robot_voltage", "robot_current"):
        out[f"actual_{name}"] = ("DOUBLE", nothing)
    for kind in ("input", "output"):
        for k in range(2):
            out[f"standard_analog_{kind}{k}"] = ("DOUBLE", nothing)
    for k in range(48):
        out[f"output_int_register_{k}"] = ("INT32", lambda k=k: arm.out_ints[k])  # type: ignore[misc]
        out[f"output_double_register_{k}"] = ("DOUBLE", lambda k=k: arm.out_doubles[k])  # type: ignore[misc]
    return out


class RtdeServer:
    """All RTDE connections. `broadcast` sends every started one its outputs."""

    def __init__(self, arm: FakeArm) -> None:
        self.arm = arm
        self.outputs = _outputs(arm)
        self.clients: list[_Client] = []

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Talk to one client until it leaves."""
        client = _Client(self, writer)
        self.clients.append(client)
        try:
            while True:
                size, kind = _HEADER.unpack(await reader.readexactly(3))
                client.receive(chr(kind), await reader.readexactly(size - 3))
                await writer.drain()
        except (asyncio.IncompleteReadError, ConnectionError):
            pass
        finally:
            self.clients.remove(client)
            writer.close()

    def broadcast(self) -> None:
        """Send outputs, unless a fault keeps the line silent."""
        if Fault.RTDE_SILENT in self.arm.world.active:
            return
        for client in list(self.clients):
            if client.started:
                client.send_outputs()

    def drop(self) -> None:
        """Cut every connection."""
        for client in list(self.clients):
            client.writer.transport.abort()


class _Client:
    def __init__(self, server: RtdeServer, writer: asyncio.StreamWriter) -> None:
        self.server = server
        self.writer = writer
        self.names: list[str] = []
        self.packing = struct.Struct(">B")
        self.recipes: list[tuple[list[str], struct.Struct]] = []
        self.owned: set[str] = set()
        self.started = False

    def receive(self, kind: str, body: bytes) -> None:
        if kind == "V":
            self._send("V", b"\x01")
        elif kind == "v":
            self._send("v", struct.pack(">4I", *VERSION))
        elif kind == "O":
            self._setup_outputs(body[8:].decode())
        elif kind == "I":
            self._setup_inputs(body.decode())
        elif kind in "SP":
            self.started = kind == "S"
            self._send(kind, b"\x01")
        elif kind == "U":
            self._take(body)

    def _setup_outputs(self, text: str) -> None:
        self.names = [n for n in text.strip().split(",") if n]
        kinds = [self.server.outputs[n][0] if n in self.server.outputs else "NOT_FOUND" for n in self.names]
        if "NOT_FOUND" not in kinds:
            self.packing = struct.Struct(">B" + "".join(_FORMATS[k] for k in kinds))
        self._send("O", b"\x01" + ",".join(kinds).encode())

    def _setup_inputs(self, text: str) -> None:
        names = [n for n in text.strip().split(",") if n]
        taken = {n for c in self.server.clients if c is not self for n in c.owned}
        kinds = ["IN_USE" if n in taken else _input_kind(n) for n in names]
        good = not {"IN_USE", "NOT_FOUND"} & set(kinds)
        if good:
            self.owned.update(n for n in names if n != "external_force_torque")
            self.recipes.append((names, struct.Struct(">" + "".join(_FORMATS[k] for k in kinds))))
        self._send("I", bytes([len(self.recipes) if good else 0]) + ",".join(kinds).encode())

    def _take(self, body: bytes) -> None:
        arm = self.server.arm
        if not 1 <= body[0] <= len(self.recipes):
            return
        names, packing = self.recipes[body[0] - 1]
        with contextlib.suppress(struct.error):
            # A client that sends five numbers where six belong is not understood; a real controller ignores it, too.
            values = list(packing.unpack(body[1:]))
            for name, following in zip(names, [*names[1:], ""], strict=True):
                if name.removesuffix("_mask") in _OUTPUT_BANKS and following == name.removesuffix("_mask"):
                    first, count = _OUTPUT_BANKS[following]
                    mask, states = values.pop(0), values.pop(0)
                    for k in range(count):
                        if mask >> k & 1:
                            arm.switch(first + k, bool(states >> k & 1))
                elif name in _OUTPUT_BANKS:
                    continue
                elif name in _IGNORED:
                    values.pop(0)
                elif name.startswith("input_int_register_"):
                    arm.ints[int(name[19:])] = values.pop(0)
                elif name.startswith("input_double_register_"):
                    arm.doubles[int(name[22:])] = values.pop(0)
                else:
                    del values[:6]
            if "input_int_register_0" in names:
                arm.feed()
                arm.command()

    def send_outputs(self) -> None:
        values: list[float | int] = []
        for name in self.names:
            value = self.server.outputs[name][1]()
            values.extend(value if isinstance(value, list) else [value])
        # A client that does not read must not make the controller wait.
        if self.writer.transport.get_write_buffer_size() < 1 << 16:
            self._send("U", self.packing.pack(1, *values))

    def _send(self, kind: str, body: bytes) -> None:
        self.writer.write(_HEADER.pack(len(body) + 3, ord(kind)) + body)


def _input_kind(name: str) -> str:
    if name.removesuffix("_mask") in _OUTPUT_BANKS:
        return "UINT8"
    if name in _IGNORED:
        return _IGNORED[name]
    if name.startswith("input_int_register_"):
        return "INT32"
    if name.startswith("input_double_register_"):
        return "DOUBLE"
    return "VECTOR6D" if name == "external_force_torque" else "NOT_FOUND"
