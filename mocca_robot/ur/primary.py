"""The controller's primary interface, read once: the kinematics that the factory measured for this arm.

Messages are big-endian: size (int32, with this header) and type (uint8). A robot state (type 16) holds packages with
headers of the same kind; package 5 is the kinematics: six checksums, then θ, a, d and α of six joints, nominal and
corrections together, then a status (as the ROS driver of Universal Robots reads it).
"""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Iterator

from mocca_robot.plan.calibration import Calibration
from mocca_robot.plan.pose import six
from mocca_robot.tolerances import LEAST_WAIT_S

PORT = 30001
PATIENCE_S = 3.0
ROBOT_STATE, KINEMATICS = 16, 5
HEADER = struct.Struct(">iB")
TABLE = struct.Struct(">6I6d6d6d6dI")
LARGEST = 1 << 20
"""No message is longer; a length that is, was none."""


def read_calibration(host: str) -> Calibration | None:
    """Return what the controller at `host` knows of its arm, None when it does not say so within three seconds."""
    end, received = time.monotonic() + PATIENCE_S, b""
    try:
        with socket.create_connection((host, PORT), timeout=PATIENCE_S) as connection:
            while time.monotonic() < end:
                connection.settimeout(max(end - time.monotonic(), LEAST_WAIT_S))
                piece = connection.recv(65536)
                if not piece:
                    return None
                received += piece
                while (message := _next(received)) is not None:
                    kind, body, received = message
                    found = _kinematics(body) if kind == ROBOT_STATE else None
                    if found is not None:
                        return found
    except (OSError, ValueError):
        return None
    return None


def _next(data: bytes) -> tuple[int, bytes, bytes] | None:
    """Return type and body of the first whole message, and the rest; ValueError for what is none."""
    if len(data) < HEADER.size:
        return None
    size, kind = HEADER.unpack_from(data)
    if not HEADER.size <= size <= LARGEST:
        raise ValueError(f"a message of {size} bytes")
    return None if len(data) < size else (kind, data[HEADER.size : size], data[size:])


def _packages(body: bytes) -> Iterator[tuple[int, bytes]]:
    while (package := _next(body)) is not None:
        kind, content, body = package
        yield kind, content


def _kinematics(body: bytes) -> Calibration | None:
    for kind, content in _packages(body):
        if kind == KINEMATICS and len(content) >= TABLE.size:
            values = TABLE.unpack_from(content)
            theta, a, d, alpha = (six(values[k : k + 6]) for k in (6, 12, 18, 24))
            return Calibration(theta=theta, a=a, d=d, alpha=alpha, checksum=values[:6])
    return None


def kinematics_message(calibration: Calibration) -> bytes:
    """Return a robot state that holds nothing but this; a controller sends one ten times a second."""
    checksum = (*calibration.checksum, *[0] * 6)[:6]
    table = TABLE.pack(*checksum, *calibration.theta, *calibration.a, *calibration.d, *calibration.alpha, 1)
    package = HEADER.pack(HEADER.size + len(table), KINEMATICS) + table
    return HEADER.pack(HEADER.size + len(package), ROBOT_STATE) + package
