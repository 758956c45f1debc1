"""A person leads the arm, this program only looks: places of the tool's tip, and whether tool and payload are right.

Nothing is sent to the arm. The person uses the freedrive of the pendant, whose enabling device is in their hand.
"""

from __future__ import annotations

import time
from types import TracebackType

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.errors import InputError
from mocca_robot.plan.arm_models import RobotModel
from mocca_robot.plan.guards import STILL_RAD_S
from mocca_robot.plan.limits import MotionLimits
from mocca_robot.plan.pose import Six, distance_m
from mocca_robot.plan.status import ArmState
from mocca_robot.plan.supervision import Stopped
from mocca_robot.ur.link import LinkLost
from mocca_robot.ur.monitor import CYCLE_S, Monitor

STILL_S, PATIENCE_S = 0.3, 10.0
"""A touched place is the mean over so long a rest; so long a hand may take to hold still."""
CREEP_M = 3e-4
"""A tip that moved by more during its rest did not rest."""
PAYLOAD_KG, TCP_M = 0.1, 1e-3
"""The controller's payload and tool may differ from the cell's by no more."""


class Touching:
    """The states of the arm at `host`, looked at between entering and leaving; InputError when there are none."""

    def __init__(self, host: str, model: RobotModel) -> None:
        self._host, self._model = host, model
        self._monitor = Monitor(host, MotionLimits(), lambda: "")

    def __enter__(self) -> Touching:
        try:
            self._monitor.open()
            self._monitor.poll()
        except (LinkLost, Stopped) as error:
            self._monitor.close()
            raise InputError(f"The arm at {self._host} cannot be looked at: {error}.") from error
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._monitor.close()

    def differs(self, tcp: Six, mass_kg: float) -> list[str]:
        """Return how the controller's payload and tool differ from the cell's, as sentences with what to do."""
        state = self._state()
        out = []
        if abs(state.payload_kg - mass_kg) > PAYLOAD_KG:
            out.append(
                f"the controller calculates with a payload of {state.payload_kg:.2f} kg, the cell's tool weighs "
                f"{mass_kg:.2f} kg: in freedrive the arm would sink or rise. Set the payload at the pendant"
            )
        gap = distance_m(state.tcp, self._model.tcp_pose(state.q, tcp))
        if gap > TCP_M:
            out.append(
                f"the controller's tool centre point is {1e3 * gap:.1f} mm from the cell's: check tcp_offset_m in the "
                "cell file, and the TCP of the installation"
            )
        return out

    def tip(self, offset: Six) -> Array:
        """Return where (3,) the point `offset` of the flange's frame is, once the arm has held still for a moment.

        InputError when it does not hold still, or cannot be seen any more.
        """
        end, seen = time.monotonic() + PATIENCE_S, list[Array]()
        since: float | None = None
        while time.monotonic() < end:
            state = self._state()
            if max(abs(v) for v in state.qd) > STILL_RAD_S:
                since, seen = None, []
            else:
                since = state.time_s if since is None else since
                place = np.array(self._model.tcp_matrix(state.q, offset)[:3, 3])
                if seen and np.linalg.norm(place - seen[0]) > CREEP_M:
                    since, seen = state.time_s, []
                seen.append(place)
                if state.time_s - since >= STILL_S:
                    return np.asarray(np.mean(seen, axis=0))
            time.sleep(CYCLE_S)
        raise InputError(f"The arm did not hold still for {PATIENCE_S:g} s. Let go of freedrive, then press Enter.")

    def _state(self) -> ArmState:
        try:
            return self._monitor.poll()
        except Stopped as stop:
            raise InputError(f"The arm at {self._host} can no longer be looked at ({stop.status}): {stop}.") from stop
