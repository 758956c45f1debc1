"""One process owns a robot: a lock held by the kernel, which disappears with the process however that ends."""

from __future__ import annotations

import os
import re
import tempfile
from pathlib import Path
from types import TracebackType

from mocca_robot.errors import EnvironmentNeeded, InputError


class RobotLock:
    """The right to move one robot from this machine, as a context manager.

    The lock is advisory and local: the driver also asks the controller whether another program is running.
    """

    def __init__(self, host: str) -> None:
        self.host = host
        safe = re.sub(r"[^A-Za-z0-9.-]", "_", host)
        self.path = Path(tempfile.gettempdir()) / f"mocca-robot-{safe}.lock"
        self._descriptor = -1

    def __enter__(self) -> RobotLock:
        try:
            import fcntl
        except ImportError:
            raise EnvironmentNeeded("Driving a robot needs Linux or macOS; this system has no lock for it.") from None
        try:
            descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError as error:
            raise EnvironmentNeeded(
                f"Cannot open the robot's lock {self.path} ({error.strerror}). Another user may own the robot: "
                "ask them."
            ) from error
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.read(descriptor, 100).decode(errors="replace").strip() or "unknown"
            os.close(descriptor)
            raise InputError(
                f"Robot {self.host} is owned by another process of this machine (pid {holder}). "
                "Wait until it has ended; two programs never share an arm."
            ) from None
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, f"{os.getpid()}\n".encode(), 0)
        self._descriptor = descriptor
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # Closing releases the lock; the file stays, since removing it would race with a waiting process.
        os.close(self._descriptor)
        self._descriptor = -1
