"""A studio of one's own for tests: the real server on a free port of this machine, and a small client for it."""

from __future__ import annotations

import asyncio
import http.client
import json
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import uvicorn

from mocca_robot.cli.studio.command import listen
from mocca_robot.cli.studio.web import Studio, application

TOKEN = "a-token-for-tests"
PATIENCE_S = 40.0
"""Machines that run tests are busy."""


class Client:
    """Talks to one window of a studio; `host`, `origin` and `cookie` can be told wrongly on purpose."""

    def __init__(self, port: int, window: str = "window") -> None:
        self.port, self.window = port, window
        self.headers = {"cookie": f"mocca-studio-{port}={TOKEN}"}

    @property
    def address(self) -> str:
        """Return what a browser opens first."""
        return f"http://127.0.0.1:{self.port}/?token={TOKEN}"

    def get(self, path: str, **headers: str) -> tuple[int, bytes]:
        """Return status and body."""
        return self._request("GET", path, None, headers)

    def post(self, what: str, **body: Any) -> dict[str, Any]:
        """Return the answer to a request of the page."""
        content = json.dumps(body).encode()
        return dict(json.loads(self._request("POST", f"/api/{self.window}/{what}", content, {})[1]))

    def drop(self, files: dict[str, bytes], **head: Any) -> dict[str, Any]:
        """Return the answer to dropped files."""
        listed = [{"name": n, "size": len(c)} for n, c in files.items()]
        content = json.dumps({"files": listed, **head}).encode() + b"\n" + b"".join(files.values())
        return dict(json.loads(self._request("POST", f"/api/{self.window}/drop", content, {})[1]))

    @contextmanager
    def events(self) -> Iterator[Callable[[Callable[[dict[str, Any]], bool]], dict[str, Any]]]:
        """Yield a function that waits for the first event for which something holds."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE_S)
        connection.request("GET", f"/api/{self.window}/events", headers=self.headers)
        answer = connection.getresponse()
        assert answer.status == 200

        def until(holds: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
            while True:
                line = answer.readline()
                assert line, "the stream has ended"
                if line.startswith(b"data: "):
                    event = dict(json.loads(line[6:]))
                    if holds(event):
                        return event

        try:
            yield until
        finally:
            connection.close()

    def _request(self, method: str, path: str, body: bytes | None, headers: dict[str, str]) -> tuple[int, bytes]:
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE_S)
        connection.putrequest(method, path, skip_host=True)
        for name, value in {"host": f"127.0.0.1:{self.port}", **self.headers, **headers}.items():
            connection.putheader(name, value)
        if body is not None:
            connection.putheader("content-length", str(len(body)))
        connection.endheaders(body)
        answer = connection.getresponse()
        content = answer.read()
        connection.close()
        return answer.status, content


@contextmanager
def studio(start: Path, first: Path | None = None) -> Iterator[Client]:
    """Yield a client of a studio that was started in the folder `start`."""
    listening = listen(0)
    port = listening.getsockname()[1]
    server: uvicorn.Server | None = None
    ready = threading.Event()

    def serve() -> None:
        async def main() -> None:
            nonlocal server
            windows = Studio(start, first)
            config = uvicorn.Config(application(windows, TOKEN, port), log_level="warning", timeout_graceful_shutdown=1)
            server = uvicorn.Server(config)
            ready.set()
            try:
                await server.serve(sockets=[listening])
            finally:
                windows.close()

        asyncio.run(main())

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    ready.wait(PATIENCE_S)
    try:
        yield Client(port)
    finally:
        assert server is not None
        server.should_exit = True
        thread.join(PATIENCE_S)
