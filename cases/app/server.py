"""The server of the desk: on 127.0.0.1, for who has the token of the address."""

from __future__ import annotations

import asyncio
import logging
import secrets
import signal
import socket
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from hmac import compare_digest
from pathlib import Path
from types import FrameType
from typing import Any

import click
import panel as pn
from bokeh.server.auth_provider import AuthProvider
from bokeh.server.views.auth_request_handler import AuthRequestHandler
from tornado.web import HTTPError, RequestHandler, authenticated
from tornado.websocket import WebSocketClosedError

from softehl.cases.app.page import AppPage
from softehl.cases.app.runs import Desk
from softehl.cases.harness.errors import BadInput
from softehl.cases.harness.signals import Ended
from softehl.system import END_SIGNALS

HOST = "127.0.0.1"
_PAGE, _LOGIN = "/desk", "/refused"
_KINDS = {".html": "text/html; charset=utf-8", ".xlsx": "application/octet-stream"}


class Refusal(RequestHandler):
    """Answer to a request without the token."""

    def get(self) -> None:
        """Say what is missing."""
        self.set_status(403)
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish("This address needs the token that `softehl app` printed.\n")


class Token(AuthProvider):
    """Lets in who has the token, in the address or since then in a cookie of this port."""

    def __init__(self, token: str, port: int) -> None:
        self.token = token
        self.cookie = f"softehl-{port}"
        super().__init__()

    @property
    def get_user(self) -> Callable[[Any], Any]:
        """A function from a request to its user, None without the token."""
        return self._user

    @property
    def login_url(self) -> str:
        """The address that requests without the token are sent to."""
        return _LOGIN

    @property
    def login_handler(self) -> type[RequestHandler]:
        """The handler of that address."""
        return Refusal

    def _user(self, handler: RequestHandler) -> str | None:
        token = handler.get_query_argument("token", "")
        if compare_digest(token.encode(), self.token.encode()):
            handler.set_cookie(self.cookie, self.token, httponly=True, samesite="Strict")
            return "engineer"
        cookie = handler.get_cookie(self.cookie) or ""
        return "engineer" if compare_digest(cookie.encode(), self.token.encode()) else None


class Files(AuthRequestHandler):
    """Reports, sheets and case files of runs: /file/report.html?run=A&run=B."""

    def initialize(self, desk: Desk) -> None:
        """The desk whose runs they are."""
        self.desk = desk

    @authenticated
    async def get(self, kind: str) -> None:
        """Make the file and send it."""
        names = self.get_query_arguments("run")
        if not names or not set(names) <= set(self.desk.names()):
            raise HTTPError(404, reason="no such run")
        if kind == "case.toml":
            self._send(f"{names[0]}.toml", self.desk.case_file(names[0]).encode())
            return
        with tempfile.TemporaryDirectory() as temporary:
            await self._report([str(self.desk.folder / name) for name in names], Path(temporary))
            name = "-and-".join(names)[:80]
            self._send(f"{name}{Path(kind).suffix}", (Path(temporary) / kind).read_bytes())

    async def _report(self, folders: list[str], target: Path) -> None:
        """`softehl report`, in a process of its own."""
        process = await asyncio.create_subprocess_exec(
            sys.executable,
            *["-m", "softehl", "report", *folders],
            *["--xlsx", "--out", str(target / "report.html")],
            stdout=asyncio.subprocess.DEVNULL,
            stderr=asyncio.subprocess.PIPE,
        )
        _, error = await process.communicate()
        if process.returncode:
            raise HTTPError(409, reason=" ".join(error.decode(errors="replace").split())[:200])

    def _send(self, name: str, content: bytes) -> None:
        kind = _KINDS.get(Path(name).suffix, "text/plain; charset=utf-8")
        self.set_header("Content-Type", kind)
        if not name.endswith(".html"):
            self.set_header("Content-Disposition", f'attachment; filename="{name}"')
        self.finish(content)


def serve(folder: Path, port: int, *, show: bool) -> None:
    """Serve the desk until the process is ended.  Raises BadInput where the port is taken."""
    desk = Desk(folder)
    try:
        server, address = make(desk, port)
    except OSError as error:
        raise BadInput(f"--port {port}: {error.strerror}; allowed: a free one, or none") from None
    click.echo(address)
    if show:
        server.io_loop.add_callback(click.launch, address)
    _expect_pages_that_close(server.io_loop)
    try:
        server.start()
        with _ended_by(server.io_loop) as numbers:
            server.io_loop.start()
    finally:
        desk.close()
    if numbers:
        raise Ended(numbers[0])


def _expect_pages_that_close(loop: Any) -> None:
    """Say nothing of pages that are closed or reloaded while something is sent to them."""
    logging.getLogger("bokeh.server.views.ws").setLevel(logging.ERROR)

    def tell(running: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        if not isinstance(context.get("exception"), WebSocketClosedError):
            running.default_exception_handler(context)

    loop.asyncio_loop.set_exception_handler(tell)


@contextmanager
def _ended_by(loop: Any) -> Iterator[list[int]]:
    """Let signals end a loop; they are listed. An exception would be lost in the loop."""
    numbers: list[int] = []

    def end(number: int, _: FrameType | None) -> None:
        numbers.append(number)
        loop.add_callback_from_signal(loop.stop)

    previous = {number: signal.signal(number, end) for number in END_SIGNALS}
    try:
        yield numbers
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)


def make(desk: Desk, port: int) -> tuple[Any, str]:
    """A server that is not started, and its address with the token."""
    token = secrets.token_urlsafe(24)
    port = port or _free_port()
    server = pn.io.server.get_server(
        {_PAGE: lambda: AppPage(desk).view()},
        port=port,
        address=HOST,
        websocket_origin=[f"{HOST}:{port}"],
        title="softehl",
        auth_provider=Token(token, port),
        extra_patterns=[(r"/file/(report\.html|report\.xlsx|case\.toml)", Files, {"desk": desk})],
    )
    return server, f"http://{HOST}:{server.port}{_PAGE}?token={token}"


def _free_port() -> int:
    with socket.socket() as listener:
        listener.bind((HOST, 0))
        return int(listener.getsockname()[1])
