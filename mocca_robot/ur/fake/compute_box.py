"""A fake Compute Box of OnRobot: Modbus TCP with the few registers that an RG2 or RG6 is driven by."""

from __future__ import annotations

import asyncio
import struct

from mocca_robot.tolerances import MM
from mocca_robot.ur.fake.arm import FakeArm

RG_PORT = 10502
"""Not Modbus's own 502, which needs an administrator to listen on."""
STATUS, WIDTH, GRIPPED = 268, 275, 2
TENTH = 10.0
ILLEGAL = 0x80
"""Added to a function that is not understood."""


class ComputeBox:
    """The box in front of the fake arm's fingers; `safety` is what its status adds."""

    def __init__(self, arm: FakeArm) -> None:
        self._arm = arm
        self.safety = 0

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Answer one client until it leaves."""
        try:
            while True:
                number, _, length, device = struct.unpack(">HHHB", await reader.readexactly(7))
                answer = self._answer(await reader.readexactly(length - 1))
                writer.write(struct.pack(">HHHB", number, 0, len(answer) + 1, device) + answer)
                await writer.drain()
        except (asyncio.IncompleteReadError, ConnectionError):
            pass
        finally:
            writer.close()

    def _answer(self, body: bytes) -> bytes:
        function, register, count = struct.unpack(">BHH", body[:5])
        if function == 3 and count == 1:
            return struct.pack(">BBH", 3, 2, self._value(register))
        if function == 16 and register == 0 and count == 3:
            _, width, _ = struct.unpack(">3H", body[6:12])
            self._arm.close_gripper(MM * width / TENTH)
            return struct.pack(">BHH", 16, register, count)
        return bytes([function | ILLEGAL, 2])

    def _value(self, register: int) -> int:
        arm = self._arm
        if register == STATUS:
            return (GRIPPED if arm.gripper_blocked else 0) | self.safety
        return round(TENTH * arm.gripper_m / MM) if register == WIDTH else 0
