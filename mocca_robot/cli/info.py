"""`mocca-robot info`: versions, solvers, OpenGL, Python and processor, for users and bug reports."""

from __future__ import annotations

import argparse
import os
import platform
import subprocess
import sys
from typing import Any

from mocca_robot.cli import arguments
from mocca_robot.cli.console import Console
from mocca_robot.cli.exit_code import ExitCode, positive_if
from mocca_robot.runtime.machine import processor
from mocca_robot.tolerances import TOLERANCES

PACKAGES = (
    *("numpy", "scipy", "networkx", "shapely", "trimesh", "manifold3d", "mapbox-earcut", "lxml", "mujoco"),
    *("svgelements", "ezdxf", "pyyaml", "rich", "viser", "mink", "ur-rtde", "imageio-ffmpeg"),
)
SOLVERS = ("daqp", "piqp", "clarabel", "osqp", "numba")
RENDER = "import mujoco; c = mujoco.GLContext(16, 16); c.make_current(); c.free(); print('works')"


def add(commands: Any) -> None:
    """Add the command."""
    text = "print versions of packages and solvers, OpenGL, Python, processor, and whether a robot answers"
    parser: argparse.ArgumentParser = commands.add_parser("info", help=text, description=text)
    parser.add_argument("--robot", metavar="HOST", help="ask the controller there who it is; nothing moves")
    arguments.add_json(parser)
    parser.set_defaults(run=run)


def own_version() -> str:
    """Return the installed version, 'unknown' in a checkout that was never installed."""
    return version("mocca-robot") or "unknown"


def version(package: str) -> str | None:
    """Return the version of an installed package, None when it is not installed."""
    from importlib import metadata  # it takes longer to import than `--help` may

    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def run(args: argparse.Namespace) -> int:
    """Return 0 after telling what is installed, and 1 when the robot that was asked for does not answer."""
    console = Console(args.json)
    with console.stage("look"):
        found: dict[str, Any] = {
            "version": own_version(),
            "python": platform.python_version(),
            "executable": sys.executable,
            "system": platform.platform(),
            "cpu": processor(),
            "cores": os.cpu_count(),
            "solvers": {name: solver(name) for name in SOLVERS},
            "packages": {name: version(name) for name in PACKAGES},
            "opengl": {name: opengl(name) for name in ("egl", "osmesa", "glfw")},
        }
    console.say(f"mocca-robot {found['version']}, Python {found['python']} ({found['executable']})")
    console.say(f"{found['system']}; {found['cpu']}, {found['cores']} cores")
    for title in ("solvers", "packages", "opengl"):
        versions = (f"{name} {value or 'not installed'}" for name, value in found[title].items())
        console.say(f"{title}: {', '.join(versions)}")
    if not any(state == "works" for state in found["opengl"].values()):
        console.say("No OpenGL: pictures and films of MuJoCo need libegl1 or libosmesa6; all numbers come without.")
    if args.robot is None:
        return console.finish(ExitCode.POSITIVE, found)
    with console.stage("robot"):
        found["robot"] = robot(args.robot)
    for key, value in found["robot"].items():
        console.say(f"robot {key.replace('_', ' ')}: {value}")
    return console.finish(positive_if("problem" not in found["robot"]), found)


def robot(host: str) -> dict[str, Any]:
    """Return what the controller at `host` says about itself, or the 'problem' that keeps it from answering."""
    from dataclasses import asdict

    from mocca_robot.errors import EnvironmentNeeded
    from mocca_robot.ur.dashboard import identify

    try:
        return {"host": host, **asdict(identify(host))}
    except (EnvironmentNeeded, OSError, ValueError) as error:
        return {"host": host, "problem": str(error)}


def solver(name: str) -> str | None:
    """Return the package's version when its solver (numba: our own) gets a small equilibrium right, else what happened.

    Our own is compiled here if it never was on this computer.
    """
    found = version(name)
    if found is None:
        return None
    import numpy as np

    from mocca_robot.statics.solver.interior_point import solve_interior_point
    from mocca_robot.statics.solver.solvers import kkt_residual, solve
    from mocca_robot.statics.solver.system import ContactSystem

    points = np.array([[0.0, 0.0], [1.0, 0.0]])
    normals = np.array([[0.0, 1.0], [0.0, 1.0]])
    free = np.array([False, True])
    system = ContactSystem.build(np.array([[0, 1], [0, 1]]), points, normals, free, length=1.0)
    wrench = np.array([0.0, -1.0, -0.5])
    price = np.zeros(2)
    try:
        if name == "numba":
            velocity, forces = solve_interior_point(system, wrench, price)
        else:
            velocity, forces = solve(system.matrix, wrench, price, name)
    except Exception as error:  # whatever a broken installation raises is the answer
        return f"{found} does not work: {error}"
    residual = kkt_residual(system.matrix, wrench, price, velocity, forces)
    return found if residual < TOLERANCES.equilibrium_residual else f"{found} is inaccurate (residual {residual:.1e})"


def opengl(backend: str) -> str:
    """Return 'works' when a context can be made in a process of its own, else the last line it said."""
    if backend == "glfw" and sys.platform.startswith("linux"):
        if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
            return "no display"
    environment = {**os.environ, "MUJOCO_GL": backend}
    try:
        done = subprocess.run(
            [sys.executable, "-c", RENDER], env=environment, capture_output=True, text=True, timeout=20, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return f"not available ({type(error).__name__})"
    if done.returncode == 0 and "works" in done.stdout:
        return "works"
    lines = [line for line in done.stderr.splitlines() if line.strip() and not line.startswith(" ")]
    errors = [line for line in lines if "Error" in line]
    return f"not available ({(errors or lines or ['stopped without a word'])[0][:120]})"
