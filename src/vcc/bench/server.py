"""The bench in a browser: pages and a WebSocket on this machine, one session per client."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import hmac
import secrets
import signal
import socket
import sys
import threading
import webbrowser
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.bench.carried import DamagedMessage, packed, unpacked
from vcc.bench.inbox import Broken
from vcc.bench.offered import Offered
from vcc.bench.session import Session

if TYPE_CHECKING:
    from starlette.applications import Starlette
    from starlette.requests import Request
    from starlette.responses import Response
    from starlette.websockets import WebSocket

LOOPBACK = "127.0.0.1"
MOST_CLIENTS = 10
"""Concurrent clients, including disconnected ones that may come back."""
KEPT = 600.0
"""Seconds for which the session of a disconnected client is kept."""
LARGEST_MESSAGE = 2**25
"""Bytes of a message that a client may send: a photograph, or a camera with some hundred masks of 128×128."""
MOST_UNSENT = 2**26
"""Bytes that may wait for a slow client; above, it is disconnected."""
NEWEST_ONLY = ("picture", "state", "progress", "notes", "value")
"""Kinds of messages of which only the newest is sent."""
SWITCH = 0.0005
"""Seconds after which a thread that computes lets one that sends go on; Python's own 5 ms delay each message."""
STATIC = "static"
TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}
"""File endings that are served, and their media types."""
HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' blob: data:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-cache",
}

TOO_MANY, BROKEN, FORBIDDEN = 1013, 1008, 4403
"""Close codes of the WebSocket: try again later, invalid message, missing token."""


@dataclass(frozen=True)
class Door:
    """Access control of a bench: every client needs the token, since this machine may have other users.

    Args:
        host: the address that the server listens on.
        token: required from clients.
    """

    host: str
    token: str

    @classmethod
    def of(cls, host: str = LOOPBACK) -> Door:
        """With a random token."""
        return cls(host, secrets.token_urlsafe(24))

    def opens(self, token: str | None, origin: str | None, asked: str | None) -> bool:
        """Whether a client may connect.

        Web pages of other sites may open sockets to this machine. Therefore the origin that the browser
        reports must equal the requested host; a foreign domain that resolves to this machine lacks the token.

        Args:
            token: sent by the client.
            origin: of the page, as reported by the browser; None without a browser.
            asked: the requested host.
        """
        if not hmac.compare_digest((token or "").encode(errors="replace"), self.token.encode()):
            return False
        try:
            return origin is None or urlsplit(origin).netloc == asked
        except ValueError:  # no address at all
            return False


class Outbox:
    """Messages that wait to be sent to one client; a newer image replaces an unsent one.

    Args:
        wake: called from any thread if there is a message, or if the client must be disconnected.
    """

    def __init__(self, wake: Callable[[], None]) -> None:
        self._wake = wake
        self._waiting: list[tuple[str, bytes]] = []
        self._lock = threading.Lock()
        self.overfull = False

    def put(self, message: dict[str, Any], buffers: Sequence[bytes]) -> None:
        """Add a message; callable from any thread."""
        kind, data = str(message["is"]), packed(message, buffers)
        with self._lock:
            if kind in NEWEST_ONLY:
                self._waiting = [each for each in self._waiting if each[0] != kind]
            self._waiting.append((kind, data))
            self.overfull = self.overfull or sum(len(each) for _, each in self._waiting) > MOST_UNSENT
        self._wake()

    def take(self) -> list[bytes]:
        """Remove and return all waiting messages."""
        with self._lock:
            taken, self._waiting = self._waiting, []
        return [data for _, data in taken]


class Clients:
    """The connected clients of a bench, and those that disconnected recently.

    Each client receives a key. After its connection broke (a laptop that slept, a lost network), the key
    alone restores its session: undo history and pinned image.

    Args:
        offered: the light fields, cameras and files of the bench.
        door: access control.
    """

    def __init__(self, offered: Offered, door: Door) -> None:
        self.offered, self.door = offered, door
        self._sessions: dict[str, Session] = {}
        self._sockets: dict[str, WebSocket] = {}
        self._gone: dict[str, asyncio.TimerHandle] = {}

    async def serve(self, socket: WebSocket) -> None:
        """Serve one client until it disconnects."""
        headers, asked = socket.headers, socket.query_params
        if not self.door.opens(asked.get("token"), headers.get("origin"), headers.get("host")):
            await socket.accept()  # so that the page learns why
            await socket.close(FORBIDDEN, "the token is missing or of another bench")
            return
        await socket.accept()
        if not self._has_room(asked.get("key")):
            await socket.close(TOO_MANY, f"this bench has {MOST_CLIENTS} clients already")
            return
        loop, there = asyncio.get_running_loop(), asyncio.Event()

        def wake() -> None:
            with contextlib.suppress(RuntimeError):  # the server has ended
                loop.call_soon_threadsafe(there.set)

        outbox = Outbox(wake)
        key, session = self._session(asked.get("key"), socket, outbox)
        outbox.put({"is": "key", "key": key}, ())
        sending, keep = asyncio.create_task(_sent(socket, outbox, there)), True
        try:
            keep = await _received(socket, session)
        finally:
            if self._sockets.get(key) is socket:  # otherwise the client has reconnected through another socket
                self._leave(key, keep)
            sending.cancel()
            with contextlib.suppress(asyncio.CancelledError, Exception):
                await sending

    def _has_room(self, key: str | None) -> bool:
        return key in self._sessions or bool(self._gone) or len(self._sessions) < MOST_CLIENTS

    def _session(self, key: str | None, socket: WebSocket, outbox: Outbox) -> tuple[str, Session]:
        """The session of a key, or a new session with a new key; the longest disconnected one makes room."""
        if key is not None and key in self._sessions:
            if key in self._gone:
                self._gone.pop(key).cancel()
            else:  # a broken connection that was not noticed
                self._closing = asyncio.create_task(_closed(self._sockets[key]))
            self._sessions[key].go_on(outbox.put)
        else:
            if len(self._sessions) >= MOST_CLIENTS:
                self._forget(next(iter(self._gone)))
            key = secrets.token_urlsafe(24)
            self._sessions[key] = Session(self.offered, outbox.put)
        self._sockets[key] = socket
        return key, self._sessions[key]

    def _leave(self, key: str, keep: bool) -> None:
        """Suspend the session of a disconnected client; end it unless ``keep``."""
        del self._sockets[key]
        if not keep:
            self._sessions.pop(key).close()
            return
        self._sessions[key].pause()
        self._gone[key] = asyncio.get_running_loop().call_later(KEPT, self._forget, key)

    def _forget(self, key: str) -> None:
        self._gone.pop(key).cancel()
        self._sessions.pop(key).close()

    def close(self) -> None:
        """End all sessions."""
        for session in self._sessions.values():
            session.close()


async def _closed(socket: WebSocket) -> None:
    with contextlib.suppress(RuntimeError):  # already closed
        await socket.close(TOO_MANY, "this client came back by another connection")


async def _sent(socket: WebSocket, outbox: Outbox, there: asyncio.Event) -> None:
    while True:
        await there.wait()
        there.clear()
        if outbox.overfull:
            await socket.close(TOO_MANY, "the client reads too slowly")
            return
        for data in outbox.take():
            await socket.send_bytes(data)


async def _received(socket: WebSocket, session: Session) -> bool:
    """Pass messages to the session until the client disconnects; return whether it may come back.

    An invalid message ends the connection for good.
    """
    from starlette.websockets import WebSocketDisconnect

    while True:
        try:
            session.receive(*unpacked(await socket.receive_bytes()))
        except WebSocketDisconnect:
            return True
        except (DamagedMessage, Broken, KeyError) as error:  # KeyError: text where bytes are expected
            words = f"no message of a bench: {error}"
            with contextlib.suppress(RuntimeError):
                await socket.close(BROKEN, words.encode()[:120].decode(errors="ignore"))
            return False


def application(offered: Offered, door: Door, files: Mapping[str, bytes]) -> Starlette:
    """The pages and the WebSocket of a bench, as an ASGI application.

    Args:
        offered: the light fields, cameras and files of the bench.
        door: access control.
        files: the files to serve, by name, including ``index.html``; no other file is served.

    Raises:
        InputError: Starlette is not installed.
    """
    with checks.package("the bench in a browser", "starlette", "bench"):
        from starlette.applications import Starlette
        from starlette.responses import Response
        from starlette.routing import Route, WebSocketRoute
    clients = Clients(offered, door)
    pages = {f"/{name}": data for name, data in files.items()}

    async def page(request: Request) -> Response:
        path = "/index.html" if request.url.path == "/" else request.url.path
        ending = f".{path.rpartition('.')[2]}"
        if path not in pages or ending not in TYPES:
            return Response("There is no such page.", 404)
        return Response(pages[path], media_type=TYPES[ending], headers=HEADERS)

    @contextlib.asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        yield
        clients.close()

    routes = [WebSocketRoute("/bench", clients.serve), Route("/{path:path}", page, methods=["GET"])]
    return Starlette(routes=routes, lifespan=lifespan)


def static_files() -> dict[str, bytes]:
    """The files of the front end, by name: no other file is served. Empty if the front end is not installed."""
    folder = resources.files("vcc.bench") / STATIC
    if not folder.is_dir():
        return {}
    return {
        file.name: file.read_bytes()
        for file in folder.iterdir()
        if file.is_file() and f".{file.name.rpartition('.')[2]}" in TYPES
    }


def listening(host: str, port: int) -> socket.socket:
    """A listening socket; port 0 selects a free port.

    Raises:
        InputError: the port is in use, or the address does not exist.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # IPPROTO_TCP is explicit, so that asyncio sets TCP_NODELAY: otherwise an image waits 40 ms for the
    # acknowledgement of the state message.
    made = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        made.bind((host, port))
        made.listen(64)
    except OSError as error:
        made.close()
        if error.errno == errno.EADDRINUSE:
            raise InputError(
                f"port {port} is in use: choose another one with --port, or omit --port for a free one"
            ) from None
        raise InputError(f"cannot listen on {host}: {error.strerror or error}") from None
    return made


def run(
    offered: Offered, *, host: str = LOOPBACK, port: int = 0, browser: bool = True, say: Callable[[str], None]
) -> bool:
    """Serve a bench until Ctrl-C, which is its ordinary end; return whether it ended so.

    Args:
        offered: the light fields, cameras and files of the bench.
        host: the address to listen on: the loopback address, or one that other machines reach. Clients need the
            token in the printed address.
        port: 0 for a free one.
        browser: whether to open a browser.
        say: prints the address.

    Raises:
        InputError: a package is not installed, or the port is in use.
    """
    with checks.package("the bench in a browser", "uvicorn", "bench"):
        import uvicorn
        import websockets  # noqa: F401  # used by uvicorn
    door = Door.of(host)
    app = application(offered, door, static_files())
    with listening(host, port) as made:
        address = address_of(door, made.getsockname()[1])
        config = uvicorn.Config(
            app,
            log_level="critical",
            ws="websockets-sansio",
            ws_max_size=LARGEST_MESSAGE,
            ws_per_message_deflate=False,  # images are compressed already, and the time counts in a drag
            timeout_graceful_shutdown=0,
            limit_concurrency=8 * MOST_CLIENTS,
        )
        server: Any = uvicorn.Server(config)
        server.capture_signals = contextlib.nullcontext  # uvicorn's own raise the signal again at the end

        def end(*_: Any) -> None:
            server.should_exit = server.force_exit = True  # at once, with clients connected

        for each in (signal.SIGINT, signal.SIGTERM):  # for good: a second Ctrl-C interrupts nothing
            signal.signal(each, end)
        sys.setswitchinterval(SWITCH)
        say(f"The bench is at {address} (Ctrl-C ends it)")
        if browser:
            threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()
        server.run(sockets=[made])
    if server.force_exit:
        say("The bench has ended.")
    return bool(server.force_exit)


def address_of(door: Door, port: int) -> str:
    """The URL to open, with the token in its query."""
    host = f"[{door.host}]" if ":" in door.host else door.host
    if door.host in ("0.0.0.0", "::"):
        host = socket.gethostname()
    return f"http://{host}:{port}/?token={door.token}"
