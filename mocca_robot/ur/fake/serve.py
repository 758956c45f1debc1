"""The fake controller as a command: its options, and serving until Ctrl-C."""

from __future__ import annotations

import argparse
import json
from pathlib import Path


def add_fake_ur_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of `fake-ur`."""
    parser.add_argument("--host", default="127.0.0.2", help="loopback address to serve on (default 127.0.0.2)")
    parser.add_argument(
        "--plan", type=Path, help="start where this plan starts, with its parts, seats and serial number"
    )
    parser.add_argument("--model", default="ur5e", help="robot model when no plan is given (default ur5e)")
    parser.add_argument("--serial", help="serial number to answer with")
    parser.add_argument("--speedup", type=float, default=1.0, help="run the robot's clock this much faster (default 1)")
    parser.add_argument("--slider", type=float, default=1.0, help="of the pendant, 0 to 1 (default 1)")
    parser.add_argument("--noise", type=float, default=0.0, metavar="N", help="of the force sensor, 1σ (default 0)")
    parser.add_argument("--drift", type=float, default=0.0, metavar="N/MIN", help="of the force sensor (default 0)")
    parser.add_argument(
        "--calibration",
        type=float,
        default=0.0,
        metavar="MM",
        help="how far this arm's flange is from its model's, at its first pose (default 0)",
    )
    parser.add_argument(
        "--fault",
        action="append",
        default=[],
        metavar="FAULT[@MODE:NTH:DELAY_S]",
        help="make something go wrong, such as protective_stop@servo:2:0.5 or jam@force; may be repeated",
    )
    parser.add_argument("--json", action="store_true", help="print JSON lines instead of text")


def run_fake_ur(args: argparse.Namespace) -> int:
    """Run `fake-ur` until Ctrl-C."""
    from mocca_robot.plan.reader import read_plan
    from mocca_robot.ur.fake.controller import FakeController, serve

    plan = read_plan(args.plan) if args.plan is not None else None
    controller = FakeController(
        plan,
        args.model,
        args.fault,
        args.speedup,
        args.serial,
        slider=args.slider,
        noise_n=args.noise,
        drift_n_min=args.drift,
        calibration_mm=args.calibration,
    )

    def ready() -> None:
        if args.json:
            print(json.dumps({"event": "serving", "host": args.host, "serial": controller.arm.serial}), flush=True)
        else:
            print(
                f"serving a fake {controller.arm.model.name} on {args.host}, serial number {controller.arm.serial}; "
                "Ctrl-C ends it",
                flush=True,
            )

    serve(controller, args.host, ready)
    return 0
