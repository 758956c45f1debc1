"""A plan's trajectories as a table: one row per waypoint, for spreadsheets and other controllers."""

from __future__ import annotations

import csv
import io

from mocca_robot.plan.plan import Plan

COLUMNS = (
    *("step", "part", "move", "kind", "t_s"),
    *(f"q{k}_rad" for k in range(1, 7)),
    *("x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad", "gripper_m", "speed_m_s", "force_limit_n"),
)


def trajectory_csv(plan: Plan) -> str:
    """Return the plan as CSV with decimal points whatever the locale; `t_s` runs on over the whole build.

    Poses are those of the tool's centre point in the base frame, rotations as rotation vectors. Where two moves meet
    the waypoint is there twice, once for either.
    """
    out = io.StringIO()
    table = csv.writer(out, lineterminator="\n")
    table.writerow(COLUMNS)
    begun = 0.0
    for number, step in enumerate(plan.steps):
        for order, move in enumerate(step.moves):
            for w in move.path:
                rest = (move.gripper_m, move.speed_m_s, move.force_limit_n)
                values = (begun + w.t - move.path[0].t, *w.q, *w.tcp, *rest)
                table.writerow([number, step.part, order, str(move.kind), *(repr(float(v)) for v in values)])
            begun += move.path[-1].t - move.path[0].t
    return out.getvalue()
