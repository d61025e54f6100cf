"""The bench in a browser: who may come in, what is served, what ends whom. Real sockets on this machine."""

import random
import re
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from asyncio import base_events
from contextlib import ExitStack, contextmanager, suppress

import pytest
from hypothesis import given
from hypothesis import strategies as some
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

import vcc
from tests.bench.on_bench import noise, offered
from vcc import InputError
from vcc.bench import server
from vcc.bench.carried import DamagedMessage, packed, unpacked
from vcc.bench.server import LARGEST_MESSAGE, MOST_CLIENTS, Door, Outbox, application, listening

PAGES = {"index.html": b"<p>A bench.</p>", "bench.js": b"export {};", "notes.txt": b"not a page"}
LENS = """
[[elements]]
kind = "lens"
focal_length = "50 mm"

[sensor]
z = "52 mm"
shape = [200, 200]
pitch = "125 um"
"""
SHUTDOWN = socket.SHUT_RDWR
DOOR = Door("127.0.0.1", "a-token-of-tests")
uvicorn = pytest.importorskip("uvicorn")


@contextmanager
def served(door):
    """A bench behind a door: its host and port, and the running server."""
    with listening("127.0.0.1", 0) as made:
        config = uvicorn.Config(
            application(offered(), door, PAGES),
            log_level="critical",
            ws_max_size=LARGEST_MESSAGE,
            timeout_graceful_shutdown=0,
        )
        running = uvicorn.Server(config)
        thread = threading.Thread(target=running.run, kwargs={"sockets": [made]}, daemon=True)
        thread.start()
        yield f"127.0.0.1:{made.getsockname()[1]}"
        running.should_exit = running.force_exit = True
        thread.join(300)
        assert not thread.is_alive()


@pytest.fixture(scope="module")
def bench():
    with served(DOOR) as address:
        yield address


def told(socket, *kinds):
    """The next message of these kinds."""
    while True:
        message, buffers = unpacked(socket.recv(timeout=300))
        if message["is"] in kinds:
            return message, buffers


def closed(socket):
    """Why the server lets a client go."""
    try:
        while True:
            socket.recv(timeout=300)
    except ConnectionClosed as error:
        return error.rcvd.code


def code(opening):
    """How the server answers who asks for a page."""
    try:
        with urllib.request.urlopen(opening, timeout=300) as answer:
            return answer.status
    except urllib.error.HTTPError as error:
        return error.code


def test_the_front_end_and_nothing_else_is_served(bench):
    with urllib.request.urlopen(f"http://{bench}/", timeout=300) as page:
        assert page.read() == PAGES["index.html"]
        assert "default-src 'none'" in page.headers["Content-Security-Policy"]
        assert page.headers["Content-Type"].startswith("text/html")
    for path in (
        "server.py",
        "../server.py",
        "%2e%2e/server.py",
        "etc/passwd",
        "static/index.html",
        "bench",
        "notes.txt",
    ):
        assert code(f"http://{bench}/{path}") == 404, path


def test_pages_of_others_and_other_users_are_kept_out(bench):
    """Web pages may open sockets to this machine, and so may programs of its other users, who lack the token."""
    token = f"?token={DOOR.token}"
    with connect(f"ws://{bench}/bench{token}", origin=f"http://{bench}") as socket:
        socket.send(packed({"do": "hello"}))
        told(socket, "state")
    with connect(f"ws://{bench}/bench{token}") as socket:  # a program
        told(socket, "key")
    for query, origin in (
        ("", None),
        ("?token=", None),
        ("?token=another", None),
        (token[:-1], None),
        ("", f"http://{bench}"),
        (token, "http://example.org"),
        (token, "http://["),
    ):
        with connect(f"ws://{bench}/bench{query}", origin=origin) as socket:
            assert closed(socket) == 4403, (query, origin)
    tokens = {Door.of(host).token for host in ("127.0.0.1", "localhost", "0.0.0.0", "0.0.0.0")}
    assert len(tokens) == 4
    assert min(map(len, tokens)) >= 32


BROKEN = {
    "no bytes": b"",
    "too short": b"\1\0",
    "longer than it is": struct.pack("<I", 999) + b"{}",
    "no JSON": struct.pack("<I", 3) + b"{]}",
    "no table": packed([1]),  # type: ignore[arg-type]
    "no number": struct.pack("<I", 11) + b'{"turn":NaN',
    "deep": struct.pack("<I", 100000) + b"[" * 100000,
    "buffers that are not there": packed({"do": "hello", "buffers": [5]}),
    "nothing to do": packed({"is": "state"}),
    "another thing to do": packed({"do": "format"}),
    "text": "hello",
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_message_ends_that_client_only(bench, name):
    with (
        connect(f"ws://{bench}/bench?token={DOOR.token}", max_size=None) as good,
        connect(f"ws://{bench}/bench?token={DOOR.token}") as bad,
    ):
        bad.send(BROKEN[name])
        assert closed(bad) == 1008
        good.send(packed({"do": "hello"}))
        told(good, "picture")


def test_a_message_that_is_too_large_ends_that_client(bench):
    with connect(f"ws://{bench}/bench?token={DOOR.token}") as socket:
        socket.send(packed({"do": "hello", "document": "x" * LARGEST_MESSAGE}))
        assert closed(socket) == 1009


def test_ten_clients_each_with_a_bench_of_its_own(bench):
    with ExitStack() as all_of_them:
        sockets = [
            all_of_them.enter_context(connect(f"ws://{bench}/bench?token={DOOR.token}", max_size=None))
            for _ in range(MOST_CLIENTS)
        ]
        for turn, socket in enumerate(sockets):
            place = f"{52 + turn / 10} mm"
            socket.send(packed({"do": "set", "where": ["sensor", "z"], "value": place, "turn": turn}))
        with connect(f"ws://{bench}/bench?token={DOOR.token}") as one_more:
            assert closed(one_more) == 1013
        for turn, socket in enumerate(sockets):
            state, _ = told(socket, "state")
            assert state["document"]["camera"]["sensor"]["z"] == f"{52 + turn / 10} mm"
            assert told(socket, "picture")[0]["turn"] == turn
    with let_in(bench):  # those who went make room
        pass


def test_nine_clients_work_on_while_the_tenth_is_hostile():
    chance, over = random.Random(4), threading.Event()
    address = f"/bench?token={DOOR.token}"
    junk = [
        *BROKEN.values(),
        packed({"do": "load", "document": {"camera": {"sensor": {"shape": [10**6, 10**6]}}, "light_field": "x"}}),
        packed({"do": "upload", "where": ["elements", 1, "pattern"], "name": "a.png"}, [bytes(2**22)]),
        packed({"do": "set", "where": ["sensor", "z"], "value": "1e300 m"}),
        packed({"do": "add", "kind": "mask", "z": "5 mm " * 10_000}),
        packed(
            {"do": "ask", "what": "scrub", "frames": 200, "where": ["sensor", "z"], "from": "9 mm", "to": "1 m"}
        ),
    ]

    def be_hostile(bench):
        while not over.is_set():
            with suppress(ConnectionClosed, OSError), connect(f"ws://{bench}{address}", max_size=None) as socket:
                for _ in range(chance.randint(1, 40)):
                    socket.send(chance.choice(junk))
            with suppress(ConnectionClosed, OSError), connect(f"ws://{bench}/bench?token=guess") as socket:
                socket.recv(timeout=5)

    with served(DOOR) as bench, ExitStack() as there:
        sockets = [there.enter_context(coming(bench)) for _ in range(MOST_CLIENTS - 1)]
        for socket in sockets:
            socket.send(packed({"do": "hello"}))
        hostile = threading.Thread(target=be_hostile, args=(bench,), daemon=True)
        hostile.start()
        for turn in range(1, 4):
            for number, socket in enumerate(sockets):
                place = f"{50 + turn + number / 10:g} mm"
                socket.send(packed({"do": "set", "where": ["sensor", "z"], "value": place, "turn": turn}))
            for number, socket in enumerate(sockets):
                while (message := told(socket, "state", "refused", "failed")[0]).get("turn") != turn:
                    pass
                assert message["is"] == "state"
                assert message["document"]["camera"]["sensor"]["z"] == f"{50 + turn + number / 10:g} mm"
                while told(socket, "picture")[0]["turn"] != turn:
                    pass
        over.set()
        hostile.join(300)


def coming(bench, key=""):
    """A client's socket: one that comes, or comes back with a key."""
    return connect(f"ws://{bench}/bench?token={DOOR.token}{key and f'&key={key}'}", max_size=None)


def at_rest(socket):
    """The state and the whole picture that follow."""
    state, _ = told(socket, "state")
    while (picture := told(socket, "picture")[0])["coarse"]:
        pass
    return state, picture


def broken_off(socket):
    """The connection breaks without a word."""
    socket.socket.shutdown(SHUTDOWN)


@pytest.mark.parametrize("seen_to", [True, False])
def test_a_client_whose_connection_broke_comes_back_to_its_steps_and_its_pinned_picture(bench, seen_to):
    with coming(bench) as first:
        key = told(first, "key")[0]["key"]
        assert len(key) >= 32
        first.send(packed({"do": "hello", "turn": 1}))
        at_rest(first)
        first.send(packed({"do": "pin"}))
        pinned = told(first, "pins")
        assert len(pinned[0]["pins"]) == 1
        first.send(packed({"do": "set", "where": ["sensor", "z"], "value": "54 mm", "turn": 2}))
        compared = at_rest(first)[1]["psnr"]
        if seen_to:  # else the server does not know yet: a laptop that slept
            broken_off(first)
        meanwhile = [{"where": ["sensor", "z"], "value": "55 mm"}, {"where": ["sensor", "pitch"], "value": "wide"}]
        with coming(bench, key) as again:
            assert told(again, "key")[0]["key"] == key
            again.send(packed({"do": "hello", "turn": 3, "changes": meanwhile}))
            refused = told(again, "refused")[0]
            assert (refused["where"], refused["turn"]) == (["sensor", "pitch"], 3)
            assert told(again, "state")[0]["undo"]
            there = told(again, "pins")
            assert (there[0]["pins"], there[1]) == (pinned[0]["pins"], pinned[1])
            assert (pinned[0]["same"], there[0]["psnr"]) == (True, compared)
            again.send(packed({"do": "undo", "turn": 4}))
            state, picture = at_rest(again)
            assert (state["document"]["camera"]["sensor"]["z"], picture["psnr"]) == ("54 mm", compared)
            again.send(packed({"do": "undo", "turn": 5}))
            state, picture = at_rest(again)
            assert (state["document"]["camera"]["sensor"]["z"], picture["same"]) == ("52 mm", True)
        if not seen_to:
            assert closed(first) == 1013  # it was let go


def test_nobody_comes_back_without_the_key(bench):
    with coming(bench) as one:
        key = told(one, "key")[0]["key"]
        one.send(packed({"do": "set", "where": ["sensor", "z"], "value": "54 mm"}))
        told(one, "picture")
        for other in ("", key[:-1], key.lower(), "x" * 32, "../" + key):
            with coming(bench, other) as socket:
                assert told(socket, "key")[0]["key"] not in (key, other)
                socket.send(packed({"do": "hello"}))
                state, _ = told(socket, "state")
                assert state["document"]["camera"]["sensor"]["z"] == "52 mm"
        one.send(packed({"do": "hello"}))
        assert told(one, "state")[0]["document"]["camera"]["sensor"]["z"] == "54 mm"


@contextmanager
def let_in(bench, key=""):
    """A client that comes as soon as there is room, and its key; that one has gone is seen a little later."""
    end = time.monotonic() + 300
    while time.monotonic() < end:
        with coming(bench, key) as socket:
            try:
                given = told(socket, "key")[0]["key"]
            except ConnectionClosed:
                time.sleep(0.02)
                continue
            yield socket, given
            return
    raise AssertionError("nobody is let in")


def test_those_who_went_make_room_and_are_forgotten(monkeypatch):
    with served(DOOR) as bench, ExitStack() as there:
        sockets, keys = zip(*(there.enter_context(let_in(bench)) for _ in range(MOST_CLIENTS)), strict=True)
        broken_off(sockets[-1])
        with let_in(bench) as (new, key):  # in place of the one that is gone
            assert key not in keys
            with coming(bench, keys[-1]) as late:
                assert closed(late) == 1013  # nothing is kept of it, and there is no room
            monkeypatch.setattr(server, "KEPT", 0.0)
            broken_off(new)
            with let_in(bench, "x") as (_, another):
                assert another != key
            with let_in(bench, key) as (_, another):
                assert another != key


def test_of_pictures_that_were_not_taken_the_newest_is_sent():
    woken = []
    outbox = Outbox(lambda: woken.append(1))
    for turn in range(5):
        outbox.put({"is": "picture", "turn": turn}, [b"jpeg"])
    outbox.put({"is": "file", "name": "a"}, [b"1"])
    outbox.put({"is": "file", "name": "b"}, [b"2"])
    messages = [unpacked(data) for data in outbox.take()]
    assert [message.get("turn", message.get("name")) for message, _ in messages] == [4, "a", "b"]
    assert not outbox.take()
    assert not outbox.overfull
    outbox.put({"is": "file"}, [bytes(server.MOST_UNSENT + 1)])
    assert outbox.overfull


@given(
    some.dictionaries(some.text(max_size=5), some.integers() | some.text(max_size=9), max_size=4),
    some.lists(some.binary(min_size=1, max_size=20), max_size=3),
)
def test_messages_come_as_they_went(message, buffers):
    message.pop("buffers", None)
    assert unpacked(packed(message, buffers)) == (message, buffers)


@given(some.binary(max_size=60))
def test_bytes_are_a_message_or_damaged(data):
    try:
        message, _ = unpacked(data)
    except DamagedMessage:
        return
    assert isinstance(message, dict)


def test_what_is_sent_does_not_wait_for_what_was_sent_before():
    """By asyncio's own rule (`asyncio.base_events._set_nodelay`) a socket must be known to be one of TCP."""
    with listening("127.0.0.1", 0) as made, socket.create_connection(made.getsockname()):
        accepted, _ = made.accept()
        with accepted:
            base_events._set_nodelay(accepted)
            assert accepted.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)


def test_a_port_that_is_taken_is_refused():
    with listening("127.0.0.1", 0) as made, pytest.raises(InputError, match="is in use"):
        listening("127.0.0.1", made.getsockname()[1])
    with pytest.raises(InputError, match="cannot listen on"):
        listening("203.0.113.7", 0)


@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C is sent otherwise")
@pytest.mark.parametrize("meanwhile", ["a light field is opened", "a film is made"])
def test_the_command_tells_its_address_and_ends_at_once_without_a_traceback(meanwhile, tmp_path):
    command = [sys.executable, "-m", "vcc", "bench", "--no-browser"]
    if meanwhile == "a film is made":
        (tmp_path / "camera.toml").write_text(LENS)
        vcc.store.save_store(noise(), tmp_path / "scene.zarr")
        command += [str(tmp_path / "camera.toml"), str(tmp_path / "scene.zarr")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as running:
        assert running.stdout is not None
        line = running.stdout.readline()
        address = re.fullmatch(
            r"The bench is at http://(127\.0\.0\.1:\d+)/(\?token=[\w-]{32}) \(Ctrl-C ends it\)\n", line
        )
        assert address, line
        with connect(f"ws://{address[1]}/bench{address[2]}", max_size=None) as socket:
            socket.send(packed({"do": "hello"}))
            if meanwhile == "a film is made":
                told(socket, "picture")
                sweep = {"what": "film", "where": ["sensor", "z"], "from": "50 mm", "to": "54 mm", "frames": 200}
                socket.send(packed({"do": "export", **sweep}))
            told(socket, "progress")
            for _ in range(3):  # impatient
                running.send_signal(signal.SIGINT)
            out, said = running.communicate(timeout=300)
    assert running.returncode == 0
    assert out == "The bench has ended.\n"
    assert said == ""
