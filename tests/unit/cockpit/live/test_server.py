"""Access to the server: allowed clients and their number, message sizes, and commands of an operator."""

import asyncio
import socket
import stat
import threading
import time
from collections.abc import Generator
from typing import Any

import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from bridge.faults import Fault
from bridge.wire.bus_config import BusConfig
from cockpit.live import operator_link, server
from cockpit.live.operator import CommandOutcome
from cockpit.live.operator_link import kept_token
from cockpit.live.page import Page, refusal
from cockpit.live.server import Server, listening
from tests.patience import PATIENCE_S
from tests.system.ports import free_endpoint
from tests.unit.cockpit.live.made import table_of_frame

TOKEN = "the token"  # noqa: S105


def door(path: str = "/stream", host: str = "127.0.0.1:8447", origin: str = "http://127.0.0.1:8447") -> int:
    refused = refusal(path, [host], [origin], 8447, upgrades=True)
    return refused.status if refused is not None else 200


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 200),
        ({"host": "localhost:8447", "origin": "http://localhost:8447"}, 200),
        ({"path": "/", "origin": ""}, 200),
        ({"origin": "http://evil.example"}, 403),
        ({"origin": "http://127.0.0.1:9999"}, 403),  # another page of this computer
        ({"origin": "https://127.0.0.1:8447"}, 403),
        ({"origin": "null"}, 403),  # a frame in a sandbox, a file
        ({"origin": ""}, 403),
        ({"host": "evil.example:8447"}, 421),  # a name that leads to 127.0.0.1
        ({"host": "127.0.0.1"}, 421),
        ({"path": "/", "host": "evil.example:8447"}, 421),
        ({"path": "/../../etc/passwd"}, 404),
        ({"path": "/stream/"}, 404),
        ({"path": "/?x"}, 404),
        ({"path": "/%2e%2e/"}, 404),
    ],
)
def test_only_the_page_of_this_server_is_answered(headers: dict[str, str], status: int) -> None:
    assert door(**headers) == status


def test_a_header_that_is_repeated_or_missing_is_refused() -> None:
    assert refusal("/", ["127.0.0.1:1", "evil:1"], [], 1, upgrades=False) is not None
    assert refusal("/", [], [], 1, upgrades=False) is not None
    assert refusal("/stream", ["127.0.0.1:1"], ["http://127.0.0.1:1", "http://x"], 1, upgrades=True) is not None
    plain = refusal("/stream", ["127.0.0.1:1"], ["http://127.0.0.1:1"], 1, upgrades=False)
    assert plain is not None
    assert plain.status == 426


@pytest.fixture
def port() -> Generator[int]:
    """A server without a rig, at this port."""
    with listening(0) as sock:
        at = int(sock.getsockname()[1])
        stop, ready = threading.Event(), threading.Event()
        made = Server(BusConfig(endpoint=free_endpoint()), TOKEN, at)
        thread = threading.Thread(target=made.run, args=(sock, stop, ready.set))
        thread.start()
        assert ready.wait(PATIENCE_S)
        yield at
        stop.set()
        thread.join(PATIENCE_S)
        assert not thread.is_alive()


def page_of(port: int) -> Any:
    return connect(f"ws://127.0.0.1:{port}/stream", origin=f"http://127.0.0.1:{port}", max_size=None)  # type: ignore[arg-type]


def raw(port: int, request: bytes, timeout_s: float = PATIENCE_S) -> bytes:
    """The bytes that the server sends until it closes."""
    with socket.create_connection(("127.0.0.1", port), timeout=timeout_s) as sock:
        sock.sendall(request)
        received = b""
        while chunk := sock.recv(1 << 16):
            received += chunk
        return received


async def next_of(socket: Any, kind: str) -> dict[str, Any]:
    while True:
        table, _ = table_of_frame(await asyncio.wait_for(socket.recv(), PATIENCE_S))
        if table["kind"] == kind:
            return table


def test_a_page_loads_nothing_and_shows_that_no_rig_is_connected(port: int) -> None:
    head, _, body = raw(port, f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode()).partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 200")
    assert b"default-src 'none'" in head
    assert f"connect-src ws://127.0.0.1:{port}".encode() in head
    assert b"X-Frame-Options: DENY" in head
    text = body.decode()
    assert "uPlot" in text
    assert not [
        word for word in ("src=", "@import", 'href="http', "innerHTML") if word in text.replace("default-src=", "")
    ]

    async def look() -> None:
        async with page_of(port) as page:
            assert "drive_force_N.least" in (await next_of(page, "hello"))["columns"]
            first, second = await next_of(page, "now"), await next_of(page, "now")
            assert first["phase"] == "waiting"
            assert second["sent_s"] > first["sent_s"]  # the page computes the age of its data from it

    asyncio.run(look())


def test_clients_of_another_origin_are_refused_by_the_running_server(port: int) -> None:
    async def look() -> None:
        url = f"ws://127.0.0.1:{port}/stream"
        for origin in ("http://evil.example", None):
            with pytest.raises(InvalidStatus, match="403"):
                async with connect(url, origin=origin):  # type: ignore[arg-type]
                    pass
        async with page_of(port) as page:  # more than a word and a token
            await page.send("x" * 2000)
            with pytest.raises(ConnectionClosed, match="1009"):
                await next_of(page, "never")
        async with page_of(port) as page:
            await page.send('{"word": "LAUNCH"}')
            with pytest.raises(ConnectionClosed):
                await next_of(page, "never")

    asyncio.run(look())
    assert b" 421 " in raw(port, b"GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n").partition(b"\r\n")[0]
    assert (
        b"200"
        not in raw(port, b"GET / HTTP/1.1\r\nHost: x\r\nA: " + b"a" * 100_000 + b"\r\n\r\n").partition(b"\r\n")[0]
    )
    assert b"200" not in raw(port, f"POST / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode()).partition(b"\r\n")[0]


def test_a_thirteenth_page_sees_nothing_and_may_stop(port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    words: list[str] = []

    def apply_order(_bus: BusConfig, word: str) -> CommandOutcome:
        words.append(word)
        return CommandOutcome(
            "here", word, True, "FAULT", "STOP_BY_PERSON", "a person stopped it", 0.0, 0.1, "", True, False
        )

    monkeypatch.setattr(operator_link, "send_command", apply_order)

    async def look() -> None:
        pages = [await page_of(port) for _ in range(server.MOST_VIEWERS)]
        async with page_of(port) as late:
            assert "close one" in (await next_of(late, "full"))["line"]
            await late.send('{"word": "STOP"}')
            answer = await next_of(late, "answer")
            assert (answer["word"], answer["done"]) == ("STOP", True)
        for page in pages:
            await page.close()

    asyncio.run(look())
    assert words == ["STOP"]


@pytest.mark.slow
def test_silent_connections_keep_no_page_out(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    monkeypatch.setattr(server, "_OPEN_S", 2.0 * PATIENCE_S)  # none of them is closed before the page has come
    port = request.getfixturevalue("port")
    words = f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode()
    half_open = [
        socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S) for _ in range(4 * server._MOST_CONNECTIONS)
    ]
    try:
        assert b" 200 " in raw(port, words)
    finally:
        for connection in half_open:
            connection.close()


def test_where_all_connections_are_pages_the_next_is_closed_at_once(port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "_MOST_CONNECTIONS", 2)

    async def look() -> None:
        async with page_of(port) as first, page_of(port) as second:
            await next_of(first, "now")
            await next_of(second, "now")
            with pytest.raises((ConnectionResetError, AssertionError)):
                assert await asyncio.to_thread(raw, port, b"GET / HTTP/1.1\r\n\r\n")
            await next_of(first, "now")

    asyncio.run(look())


@pytest.mark.slow
def test_arming_needs_the_token_and_stop_does_not_wait_for_a_command_in_progress(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(operator_link, "_WRONG_S", 0.2)
    commands: list[str] = []
    armed = threading.Event()

    def apply_order(_bus: BusConfig, word: str) -> CommandOutcome:
        commands.append(word)
        if word == "ARM":
            armed.wait(PATIENCE_S)
        if word == "RESET":
            raise Fault("NO_PEER", "nobody there\x1b[2J")
        return CommandOutcome("here", word, True, "ARMED", "CHECK_PASSED", "", 0.0, 0.1, "", True, False)

    monkeypatch.setattr(operator_link, "send_command", apply_order)

    async def look() -> None:
        words = operator_link.Words(BusConfig(), TOKEN)
        for token in ("guess", "", "\ud800"):  # the last is half of a pair, as JSON may hold it
            wrong = await words.deliver(operator_link.Wish("ARM", token))
            assert "wrong token" in wrong["lines"][0]
        assert commands == []
        arming = asyncio.create_task(words.deliver(operator_link.Wish("ARM", TOKEN)))
        await asyncio.sleep(0.05)
        assert "in progress" in (await words.deliver(operator_link.Wish("DISARM", TOKEN)))["lines"][0]
        assert (await words.deliver(operator_link.Wish("STOP", "")))["done"]  # while the other word is under way
        armed.set()
        assert (await arming)["done"]
        failed = await words.deliver(operator_link.Wish("RESET", TOKEN))
        assert failed["lines"] == ["nobody there\\x1b[2J"]

    asyncio.run(look())
    assert commands == ["ARM", "STOP", "RESET"]


def test_a_stop_that_reaches_no_rig_is_sent_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(operator_link, "_STOP_AGAIN_S", 0.0)
    sent: list[str] = []

    def third_time(_bus: BusConfig, word: str) -> CommandOutcome:
        sent.append(word)
        if len(sent) < 3:
            raise Fault("NO_PEER", "STOP NOT DELIVERED: no rig answered")
        return CommandOutcome("here", word, True, "FAULT", "STOP_BY_PERSON", "", 0.0, 0.1, "", True, False)

    monkeypatch.setattr(operator_link, "send_command", third_time)
    stop = operator_link.Wish("STOP", "")
    assert asyncio.run(operator_link.Words(BusConfig(), TOKEN).deliver(stop))["done"]
    assert sent == ["STOP"] * 3
    sent.clear()
    monkeypatch.setattr(operator_link, "_STOP_S", -1.0)  # the time is over
    failed = asyncio.run(operator_link.Words(BusConfig(), TOKEN).deliver(stop))
    assert (failed["done"], failed["lines"]) == (False, ["STOP NOT DELIVERED: no rig answered"])
    assert sent == ["STOP"]


def test_a_wish_is_a_word_that_is_known() -> None:
    assert operator_link.wish_of('{"word": "ARM", "token": "x"}') == operator_link.Wish("ARM", "x")
    for text in (
        "",
        "[]",
        "{}",
        '{"word": 3}',
        '{"word": "ARM", "token": 3}',
        '{"word": "NOTHING"}',
        "[" * 900,
        b"\xff",
    ):
        assert operator_link.wish_of(text) is None, text


def test_a_slow_reader_is_dropped_and_the_others_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    aborted: list[str] = []

    class Socket:
        def __init__(self, name: str, reads: bool) -> None:
            self.name, self.reads, self.transport, self.got = name, reads, self, 0

        def abort(self) -> None:
            aborted.append(self.name)

        async def send(self, _frame: bytes) -> None:
            if not self.reads:
                await asyncio.sleep(3600.0)
            self.got += 1

    async def look() -> None:
        all_of_them = server.Viewers()
        slow, quick = Socket("slow", False), Socket("quick", True)
        async with all_of_them.added(slow, [b""]), all_of_them.added(quick, [b""]):  # type: ignore[arg-type]
            for _ in range(200):
                all_of_them.broadcast(b"frame")
                await asyncio.sleep(0)
            assert quick.got == 201
        assert all_of_them.dropped == 1

    asyncio.run(look())
    assert aborted == ["slow"]


@pytest.mark.slow
def test_a_missing_password_is_printed(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("cockpit.live.listener.absence", "no password for {}".format)
    made = Server(BusConfig(endpoint=free_endpoint()), TOKEN, 0)
    with made._listener:
        until_s = time.monotonic() + PATIENCE_S
        while not made._trouble and time.monotonic() < until_s:
            made._tick()
    assert made._view.now()["answer"]["text"].startswith("no password for tcp/")
    assert capsys.readouterr().err.startswith("warning  no password for tcp/")


def test_the_token_is_in_a_file_of_this_user_alone(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    with kept_token(8447) as (word, path):
        assert path.read_text() == word
        assert len(word) == 24
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
        assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700
    assert not path.exists()


def test_a_taken_port_is_reported() -> None:
    with listening(0) as sock, pytest.raises(Fault, match="choose another --port") as raised:
        listening(int(sock.getsockname()[1]))
    assert raised.value.kind.code == "ENDPOINT_BUSY"


def test_every_script_of_the_page_is_in_its_policy() -> None:
    page = Page(8447)
    assert page.policy.count("'sha256-") == page.body.decode().count("<script>") == 2
