"""`mocca-robot studio`: change an assembly on a local page and see at once what becomes of it."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mocca_robot.cli.console import Console
from mocca_robot.cli.exit_code import ExitCode
from mocca_robot.errors import EnvironmentNeeded, InputError

if TYPE_CHECKING:
    from socket import socket as Socket

DESCRIPTION = """Opens a page in your browser on which you work: drop a drawing or meshes, or open a configuration;
change angles, goals, bounds and loads; drag corners of flat parts; reorder the sequence; and see contacts, joints,
forces and verdicts at once. What you save is the YAML that every other command takes. The page is served to this
computer only, and asks the network for nothing. Needs starlette and uvicorn: pip install 'mocca-robot[studio]'.
Ctrl-C ends it."""
INSTALL = "The studio needs starlette and uvicorn: `pip install 'mocca-robot[studio]'`."
PORT = 8420
TRIED = 20
"""Ports after the usual one that are tried when it is taken and nobody asked for one."""


def add(commands: Any) -> None:
    """Add the command."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "studio", help="work on an assembly in the browser and see every change at once", description=DESCRIPTION
    )
    parser.add_argument("file", nargs="?", metavar="FILE", help="configuration, drawing or meshes to begin with")
    parser.add_argument(
        "--port", type=int, metavar="N", help=f"port on this computer (default: the first free from {PORT})"
    )
    parser.add_argument("--no-browser", action="store_true", help="only print the address")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Return 0 when Ctrl-C ends it."""
    import asyncio
    import contextlib
    import importlib
    import secrets
    import webbrowser

    try:
        for package in ("starlette", "uvicorn"):
            importlib.import_module(package)
    except ImportError:
        raise EnvironmentNeeded(INSTALL) from None
    import uvicorn

    from mocca_robot.cli.studio.web import Studio, application

    first = None
    if args.file is not None:
        from mocca_robot.files.documents import existing_path

        first = existing_path(Path(args.file).resolve())
    listening = listen(args.port)
    port = listening.getsockname()[1]
    token = secrets.token_urlsafe(24)
    console = Console()

    async def serve() -> None:
        studio = Studio(Path.cwd(), first)
        settings = uvicorn.Config(
            application(studio, token, port), log_level="warning", access_log=False, timeout_graceful_shutdown=1
        )
        studio.warm()
        address = f"http://127.0.0.1:{port}/?token={token}"
        console.say(f"{address}\n(Ctrl-C ends)")
        if not args.no_browser and not await asyncio.to_thread(webbrowser.open, address):
            console.warn("No browser could be opened; open the address above yourself.")
        try:
            await uvicorn.Server(settings).serve(sockets=[listening])
        finally:
            studio.close()

    with contextlib.suppress(KeyboardInterrupt):
        asyncio.run(serve())
    return ExitCode.POSITIVE


def listen(port: int | None) -> Socket:
    """Return a socket that listens on this computer only. Raises InputError when the port asked for is taken."""
    import socket

    if port is not None and not 0 <= port <= 65535:
        raise InputError(f"--port is {port}; give a number from 1024 to 65535, or none.")
    for candidate in (port,) if port is not None else range(PORT, PORT + TRIED):
        found = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        if os.name == "posix":  # A port just left can be taken again; on Windows the option would let two listen.
            found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            found.bind(("127.0.0.1", candidate))
        except OSError:
            found.close()
            continue
        found.listen(64)
        return found
    if port is None:
        raise InputError(f"The ports {PORT} to {PORT + TRIED - 1} are all taken; name a free one with --port N.")
    raise InputError(f"Port {port} cannot be used, something else listens there; leave --port out to find a free one.")
