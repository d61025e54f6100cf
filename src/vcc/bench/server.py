"""The bench in a browser: pages and a WebSocket on this machine, a session for each client."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import hmac
import secrets
import signal
import socket
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
from vcc.bench.offered import Offered
from vcc.bench.session import Broken, Session

if TYPE_CHECKING:
    from starlette.applications import Starlette
    from starlette.requests import Request
    from starlette.responses import Response
    from starlette.websockets import WebSocket

LOOPBACK = "127.0.0.1"
OF_THIS_MACHINE = (LOOPBACK, "localhost", "::1")
MOST_CLIENTS = 10
"""At once; those who are gone and may come back are among them."""
KEPT = 600.0
"""Seconds for which a client that is out of reach may come back to what it had."""
LARGEST_MESSAGE = 2**20
"""Bytes of a message that a client may send."""
MOST_UNSENT = 2**26
"""Bytes that may wait for a client that does not take them: it is let go then."""
NEWEST_ONLY = ("picture", "state", "progress", "notes", "value")
"""Of these only the newest is worth sending."""
STATIC = "static"
TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}
"""Endings of what is served, and their types."""
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
"""Why a WebSocket is closed: try again later, a message that is none, no token."""


@dataclass(frozen=True)
class Door:
    """Who may come in.

    Args:
        host: the address that is listened at.
        token: that clients must know; empty on this machine alone.
    """

    host: str = LOOPBACK
    token: str = ""

    @classmethod
    def of(cls, host: str) -> Door:
        """On this machine all who can reach it; elsewhere those with a token."""
        return cls(host, "" if host in OF_THIS_MACHINE else secrets.token_urlsafe(24))

    def opens(self, token: str | None, origin: str | None, asked: str | None) -> bool:
        """Whether a client may come in.

        Pages from elsewhere may open sockets to this machine: what a browser says of where a page comes from must
        be what it asked for; and on this machine, that must be this machine by name, so that no name of somebody
        else's stands for it.

        Args:
            token: that it told.
            origin: of the page, as its browser says; None without a browser.
            asked: the host that it asked for.
        """
        if self.token:
            if not hmac.compare_digest((token or "").encode(), self.token.encode()):
                return False
        elif _name_of(asked) not in OF_THIS_MACHINE:
            return False
        return origin is None or urlsplit(origin).netloc == asked


def _name_of(host: str | None) -> str | None:
    """A host without its port."""
    try:
        return urlsplit(f"//{host}").hostname if host else None
    except ValueError:
        return None


class Outbox:
    """What waits to be sent to one client; the newest picture takes the place of one that was not sent.

    Args:
        wake: called, from any thread, when there is something; and when the client is to be let go.
    """

    def __init__(self, wake: Callable[[], None]) -> None:
        self._wake = wake
        self._waiting: list[tuple[str, bytes]] = []
        self._lock = threading.Lock()
        self.overfull = False

    def put(self, message: dict[str, Any], buffers: Sequence[bytes]) -> None:
        """Add a message; from any thread."""
        kind, data = str(message["is"]), packed(message, buffers)
        with self._lock:
            if kind in NEWEST_ONLY:
                self._waiting = [each for each in self._waiting if each[0] != kind]
            self._waiting.append((kind, data))
            self.overfull = self.overfull or sum(len(each) for _, each in self._waiting) > MOST_UNSENT
        self._wake()

    def take(self) -> list[bytes]:
        """All that waits."""
        with self._lock:
            taken, self._waiting = self._waiting, []
        return [data for _, data in taken]


class Clients:
    """Those who look at a bench, and those who did a moment ago.

    A client is told a key when it comes. With it, and in no other way, it comes back to what it had (its steps,
    the pinned picture) after its connection broke: a laptop that slept, a network that was gone.

    Args:
        offered: what there is.
        door: who may come in.
    """

    def __init__(self, offered: Offered, door: Door) -> None:
        self.offered, self.door = offered, door
        self._sessions: dict[str, Session] = {}
        self._sockets: dict[str, WebSocket] = {}
        self._gone: dict[str, asyncio.TimerHandle] = {}

    async def serve(self, socket: WebSocket) -> None:
        """One client, from its coming to its going."""
        headers, asked = socket.headers, socket.query_params
        if not self.door.opens(asked.get("token"), headers.get("origin"), headers.get("host")):
            await socket.close(FORBIDDEN)
            return
        await socket.accept()
        if not self._has_room(asked.get("key")):
            await socket.close(TOO_MANY, f"{MOST_CLIENTS} look at this bench already")
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
            if self._sockets.get(key) is socket:  # else the client came back by another one
                self._leave(key, keep)
            sending.cancel()
            with contextlib.suppress(asyncio.CancelledError, Exception):
                await sending

    def _has_room(self, key: str | None) -> bool:
        return key in self._sessions or bool(self._gone) or len(self._sessions) < MOST_CLIENTS

    def _session(self, key: str | None, socket: WebSocket, outbox: Outbox) -> tuple[str, Session]:
        """That of the key, or a new one with a key of its own, for which the one longest gone makes room."""
        if key is not None and key in self._sessions:
            if key in self._gone:
                self._gone.pop(key).cancel()
            else:  # a connection that broke and was not seen to
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
        """A client is out of reach, and may come back if it is kept."""
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
    with contextlib.suppress(RuntimeError):  # it is closed already
        await socket.close(TOO_MANY, "this client came back by another connection")


async def _sent(socket: WebSocket, outbox: Outbox, there: asyncio.Event) -> None:
    while True:
        await there.wait()
        there.clear()
        if outbox.overfull:
            await socket.close(TOO_MANY, "too much waits to be taken")
            return
        for data in outbox.take():
            await socket.send_bytes(data)


async def _received(socket: WebSocket, session: Session) -> bool:
    """Hand on what a client says until it goes, or says what no client of ours does; whether it may come back."""
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
        offered: what there is.
        door: who may come in.
        files: what is served, by name, ``index.html`` among them; nothing else is.

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
        asked = request.headers.get("host")
        if not door.token and _name_of(asked) not in OF_THIS_MACHINE:
            return Response("This bench is for this machine.", 403)
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
    """The files of the front end, by name: all that is ever served. None in a copy without a front end."""
    folder = resources.files("vcc.bench") / STATIC
    if not folder.is_dir():
        return {}
    return {
        file.name: file.read_bytes()
        for file in folder.iterdir()
        if file.is_file() and f".{file.name.rpartition('.')[2]}" in TYPES
    }


def listening(host: str, port: int) -> socket.socket:
    """A socket that listens; at a free port where port is 0.

    Raises:
        InputError: the port is taken, or there is no such address.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # Named as TCP, so that asyncio sends at once: else a picture waits 40 ms until the state is acknowledged.
    made = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        made.bind((host, port))
        made.listen(64)
    except OSError as error:
        made.close()
        if error.errno == errno.EADDRINUSE:
            raise InputError(f"port {port} is taken: choose another with --port, or none for a free one") from None
        raise InputError(f"{host} cannot be listened at: {error.strerror or error}") from None
    return made


def run(
    offered: Offered, *, host: str = LOOPBACK, port: int = 0, browser: bool = True, say: Callable[[str], None]
) -> None:
    """Serve a bench until Ctrl-C.

    Args:
        offered: what there is.
        host: the address to listen at: that of this machine alone, or one that others reach, who then need the
            token in the address that is told.
        port: 0 for a free one.
        browser: whether to open one.
        say: tells the address.

    Raises:
        InputError: the package is not installed, or the address is taken.
    """
    with checks.package("the bench in a browser", "uvicorn", "bench"):
        import uvicorn
        import websockets  # noqa: F401  # by which uvicorn speaks to browsers
    door = Door.of(host)
    app = application(offered, door, static_files())
    with listening(host, port) as made:
        address = address_of(door, made.getsockname()[1])
        config = uvicorn.Config(
            app,
            log_level="critical",
            ws="websockets-sansio",
            ws_max_size=LARGEST_MESSAGE,
            timeout_graceful_shutdown=0,
            limit_concurrency=8 * MOST_CLIENTS,
        )
        server = _server(uvicorn, config)
        say(f"The bench is at {address} (Ctrl-C ends it)")
        if browser:
            threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()
        server.run(sockets=[made])
    if server.interrupted:
        raise KeyboardInterrupt


def _server(uvicorn: Any, config: Any) -> Any:
    """A server that ends at the first Ctrl-C, whoever is still there."""

    class Server(uvicorn.Server):  # type: ignore[misc]
        interrupted = False

        @contextlib.contextmanager
        def capture_signals(self) -> Any:
            def end(*_: Any) -> None:
                self.interrupted, self.should_exit, self.force_exit = True, True, True

            before = {each: signal.signal(each, end) for each in (signal.SIGINT, signal.SIGTERM)}
            try:
                yield
            finally:
                for each, handler in before.items():
                    signal.signal(each, handler)

    return Server(config)


def address_of(door: Door, port: int) -> str:
    """What to open in a browser; the token stands where it is not sent to others."""
    host = f"[{door.host}]" if ":" in door.host else door.host
    if door.host in ("0.0.0.0", "::"):
        host = socket.gethostname()
    return f"http://{host}:{port}/" + (f"?token={door.token}" if door.token else "")
