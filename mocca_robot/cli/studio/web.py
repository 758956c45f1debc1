"""The studio's server: one page, a stream of events per window, and small requests that change things."""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import AsyncIterator, Awaitable, Callable
from functools import partial
from importlib import resources
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response, StreamingResponse
from starlette.routing import Route

from mocca_robot.cli.console import plain
from mocca_robot.cli.studio import opening, tasks
from mocca_robot.cli.studio.guard import Guard
from mocca_robot.cli.studio.keys_data import keys_data
from mocca_robot.cli.studio.session import Helper, Session
from mocca_robot.config.examples import examples
from mocca_robot.errors import InputError, MoccaError

PAGE = {
    "": ("index.html", "text/html; charset=utf-8"),
    "studio.css": ("studio.css", "text/css; charset=utf-8"),
}
SCRIPT = "text/javascript; charset=utf-8"
LARGEST_REQUEST = 2 * 1024 * 1024
HEARTBEAT_S = 10.0
MOST_WINDOWS = 12
SERVED = {
    ".html": "text/html",
    ".json": "application/json",
    ".svg": "image/svg+xml",
    ".csv": "text/csv",
    ".png": "image/png",
}
REPORT_POLICY = (
    "sandbox allow-scripts allow-downloads; default-src 'none'; style-src 'unsafe-inline'; "
    "script-src 'unsafe-inline'; img-src data:"
)
"""A report runs its own script, but as a page of nobody: it cannot reach the studio."""

Answer = Callable[[Session, dict[str, Any]], Any]


class Studio:
    """All windows of one server.

    Attributes:
        start: the folder in which it was started.
        first: the file that the first window opens; None for none.
    """

    def __init__(self, start: Path, first: Path | None) -> None:
        self.start, self.first = start, first
        self.sessions: dict[str, Session] = {}
        self._spare: Helper | None = None

    def session(self, name: str) -> Session:
        """Return the window's session, a new one when it is new. Raises InputError when there are too many."""
        if not re.fullmatch(r"[A-Za-z0-9_-]{4,40}", name):
            raise InputError("A window needs a name of letters and digits.")
        if name not in self.sessions:
            self._make_room()
            found = Session(name, self.start, self._helper)
            self.sessions[name] = found
            if self.first is not None:
                found.open(self.first)
        return self.sessions[name]

    def warm(self) -> None:
        """Start a worker that the next window finds ready."""
        if self._spare is None:
            self._spare = Helper()

    def close(self) -> None:
        """End all workers and jobs."""
        for session in self.sessions.values():
            session.close()
        if self._spare is not None:
            self._spare.end()

    def _helper(self) -> Helper:
        found, self._spare = self._spare or Helper(), None
        return found

    def _make_room(self) -> None:
        """Forget the oldest window that nobody looks at, when there are many."""
        idle = [n for n, s in self.sessions.items() if not s.watched]
        while len(self.sessions) >= MOST_WINDOWS and idle:
            self.sessions.pop(idle.pop(0)).close()
        if len(self.sessions) >= MOST_WINDOWS:
            raise InputError(f"{MOST_WINDOWS} windows are open; close one.")


def application(studio: Studio, token: str, port: int) -> Guard:
    """Return the ASGI application, guarded."""

    def posted(answer: Answer) -> Callable[[Request], Awaitable[Response]]:
        async def endpoint(request: Request) -> Response:
            try:
                body = opening.as_mapping(await _json(request))
                session = studio.session(request.path_params["window"])
                found = answer(session, dict(body))
                return JSONResponse(plain({"ok": True, **(found or {})}))
            except MoccaError as error:
                return JSONResponse({"ok": False, "error": str(error)}, status_code=422)

        return endpoint

    routes = [
        Route("/", _page(*PAGE[""])),
        Route("/studio.css", _page(*PAGE["studio.css"])),
        Route("/{script:str}.js", _script),
        Route("/api/start", partial(_start, studio)),
        Route("/api/{window}/events", partial(_events, studio)),
        Route("/api/{window}/text", partial(_text, studio)),
        Route("/api/{window}/drop", partial(_drop, studio), methods=["POST"]),
        Route("/api/{window}/jobs/{number:int}/{name}", partial(_job_file, studio)),
        *(Route(f"/api/{{window}}/{n}", posted(a), methods=["POST"]) for n, a in tasks.ANSWERS.items()),
    ]

    async def failed(request: Request, error: Exception) -> Response:
        text = f"This is an error in mocca-robot, not in your input ({type(error).__name__}: {error})."
        return JSONResponse({"ok": False, "error": text}, status_code=500)

    return Guard(Starlette(routes=routes, exception_handlers={500: failed}), token, port)


def asset(name: str) -> str:
    """Return a file of the page."""
    return (resources.files("mocca_robot.cli.studio") / "page" / name).read_text(encoding="utf-8")


def _page(name: str, kind: str) -> Callable[[Request], Awaitable[Response]]:
    async def endpoint(request: Request) -> Response:
        return Response(asset(name), media_type=kind)

    return endpoint


async def _script(request: Request) -> Response:
    name = f"{request.path_params['script']}.js"
    folder = resources.files("mocca_robot.cli.studio") / "page"
    if name not in {f.name for f in folder.iterdir()}:
        return Response("No such script.\n", status_code=404)
    return Response(asset(name), media_type=SCRIPT)


async def _start(studio: Studio, request: Request) -> Response:
    """What can be opened, and every key with its meaning."""
    listed = [{"name": e.name, "about": e.about, "path": str(e.path)} for e in examples() if "/" not in e.name]
    found = await run_in_threadpool(opening.beside, studio.start)
    return JSONResponse({"examples": listed, "beside": found, "folder": str(studio.start), "keys": keys_data()})


async def _events(studio: Studio, request: Request) -> Response:
    try:
        session = studio.session(request.path_params["window"])
    except MoccaError as error:
        return JSONResponse({"ok": False, "error": str(error)}, status_code=422)
    queue = session.listen()

    async def stream() -> AsyncIterator[bytes]:
        try:
            while True:
                try:
                    event = await asyncio.wait_for(queue.get(), HEARTBEAT_S)
                    text = json.dumps(plain(event), ensure_ascii=False, allow_nan=False)
                    yield f"data: {text}\n\n".encode()
                except TimeoutError:
                    yield b": still here\n\n"
        finally:
            session.stop_listening(queue)

    return StreamingResponse(stream(), media_type="text/event-stream")


async def _text(studio: Studio, request: Request) -> Response:
    try:
        session = studio.session(request.path_params["window"])
        name = session.source.stem
        headers = {"content-disposition": f"attachment; filename*=UTF-8''{_quoted(name)}.yaml"}
        return Response(session.text(), media_type="application/yaml", headers=headers)
    except MoccaError as error:
        return JSONResponse({"ok": False, "error": str(error)}, status_code=422)


def _quoted(name: str) -> str:
    from urllib.parse import quote

    return quote(name, safe="")


async def _drop(studio: Studio, request: Request) -> Response:
    """Take dropped files: a line of JSON with their names and sizes, then their bytes one after the other."""
    try:
        session = studio.session(request.path_params["window"])
        content = await _body(request, opening.LARGEST_DROP)
        head, newline, rest = content.partition(b"\n")
        listed = opening.as_mapping(_parsed(head))
        files = []
        for entry in listed.get("files", []):
            size = int(entry["size"])
            files.append((str(entry["name"]), rest[:size]))
            rest = rest[size:]
        if rest or not newline:
            raise InputError("The dropped files came incomplete; drop them again.")
        session.drop(files, listed.get("units") or None)
        return JSONResponse({"ok": True})
    except (MoccaError, KeyError, TypeError, ValueError) as error:
        text = str(error) if isinstance(error, MoccaError) else "The dropped files came incomplete; drop them again."
        return JSONResponse({"ok": False, "error": text}, status_code=422)


async def _job_file(studio: Studio, request: Request) -> Response:
    """A file that a job wrote, by its name."""
    session = studio.session(request.path_params["window"])
    job = session.jobs.job(request.path_params["number"])
    for file in map(Path, job.files):
        if file.name == request.path_params["name"] and file.is_file():
            kind = SERVED.get(file.suffix.lower(), "application/octet-stream")
            headers = {"content-security-policy": REPORT_POLICY}
            return Response(await run_in_threadpool(file.read_bytes), media_type=kind, headers=headers)
    return Response("The job wrote no such file.\n", status_code=404)


async def _json(request: Request) -> Any:
    return _parsed(await _body(request, LARGEST_REQUEST))


def _parsed(content: bytes) -> Any:
    try:
        return json.loads(content)
    except (ValueError, RecursionError):
        raise InputError("The request is no JSON.") from None


async def _body(request: Request, limit: int) -> bytes:
    """Return the body. Raises InputError as soon as it is larger than `limit` bytes."""
    content = bytearray()
    async for chunk in request.stream():
        content += chunk
        if len(content) > limit:
            raise InputError(
                f"That is more than {limit / 2**20:g} MB; open large models with `mocca-robot studio FILE`."
            )
    return bytes(content)
