"""What a program, or a page of somebody else, can say to the page of ``hil view``: nothing but where it looks from."""

import asyncio
import contextlib
import socket
from collections.abc import AsyncIterator, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import msgspec
import pytest
import viser
import websockets
from websockets.asyncio.client import ClientConnection, connect

from hil.values.errors import EndpointError
from tests.support.processes import own_host
from tools.view.browser.gate import LOOKERS_MESSAGES_PER_S, MAX_LOOKERS, Gate
from tools.view.browser.page import first_free_port
from tools.view.token import new_token
from transport.udp import free_port

TOKEN = new_token()
CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": [1.0, 0, 0, 0], "position": [1.0, 1, 1], "fov": 1.0, "near": 0.1,
    "far": 9.0, "image_height": 9, "image_width": 9, "look_at": [0.0, 0, 0], "up_direction": [0.0, 0, 1],
}  # fmt: skip
LAST = {**CAMERA, "fov": 0.5}


class Served:
    """A viser server behind the gate, and what it was told."""

    def __init__(self, host: str) -> None:
        self.host = host
        with Gate(TOKEN, host).standing():
            self.server = viser.ViserServer(host=host, port=free_port(host), verbose=False)
        # One thread does all one after the other, so that a test can wait for all of them.
        self.server._thread_executor = self.server.gui._thread_executor = ThreadPoolExecutor(1)
        self.place = f"{host}:{self.server.get_port()}"
        self.heard: list[str] = []
        self.server.request_share_url = lambda: self.heard.append("share")  # type: ignore[method-assign,assignment,misc]
        self.box = self.server.gui.add_checkbox("box", initial_value=False)
        self.box.on_update(lambda _event: self.heard.append("box"))
        self.button = self.server.gui.add_button("hold")
        self.button.on_hold(lambda _event: self.heard.append("hold"), callback_hz=20.0)

    @contextlib.asynccontextmanager
    async def guest(self, path: str = "/", **how: Any) -> AsyncIterator[ClientConnection]:
        async with connect(
            f"ws://{self.place}{path}", subprotocols=[websockets.Subprotocol(f"viser-v{viser.__version__}")],
            max_size=None, compression=None, proxy=None, **how,
        ) as joined:  # fmt: skip
            yield joined

    def update(self, **updates: Any) -> dict[str, Any]:
        return {"type": "GuiUpdateMessage", "uuid": self.box._impl.uuid, "updates": updates}

    def hold(self) -> dict[str, Any]:
        return {"type": "GuiButtonHoldMessage", "uuid": self.button._impl.uuid, "frequency": 20.0}


@pytest.fixture(scope="module")
def served() -> Iterator[Served]:
    one = Served(own_host())
    yield one
    one.server.stop()


async def say(guest: ClientConnection, *messages: dict[str, Any]) -> None:
    for message in messages:
        await guest.send(msgspec.msgpack.encode(message))


def said(served: Served, path: str, *messages: dict[str, Any]) -> list[str]:
    """Return what viser heard of messages: what comes after them was heard, so they were not."""
    served.heard.clear()
    served.box._impl.value = False
    heard = asyncio.Event()

    async def speak() -> None:
        loop = asyncio.get_running_loop()

        async def last(_client: object, message: Any) -> None:
            if message.fov == LAST["fov"]:
                loop.call_soon_threadsafe(heard.set)

        async with served.guest(path) as guest:
            messages_class = viser._messages.ViewerCameraMessage
            served.server._websock_server.register_handler(messages_class, last)
            await say(guest, CAMERA, *messages, LAST)
            await asyncio.wait_for(heard.wait(), 5)
            served.server._websock_server.unregister_handler(messages_class, last)

    asyncio.run(speak())
    served.server._thread_executor.submit(lambda: None).result()
    return served.heard


def test_nobody_can_show_the_robots_to_the_world(served: Served) -> None:
    for path in ("/", f"/{TOKEN}"):
        assert said(served, path, {"type": "ShareUrlRequest"}, {"type": "ShareUrlDisconnect"}) == []


def test_keys_are_held_and_flanges_dragged_by_who_has_the_token_only(served: Served) -> None:
    assert said(served, "/", served.hold()) == []
    other_end = "x" if TOKEN[-1] != "x" else "y"
    assert said(served, f"/{TOKEN[:-1]}{other_end}", served.hold()) == []
    assert said(served, f"/{TOKEN}", served.hold()) == ["hold"]


@pytest.mark.parametrize(
    "updates",
    [{"removed": True}, {"update_cb": []}, {"value": [1]}, {"value": float("nan")}, {"value": "x" * 5000}, {}],
)
def test_of_an_element_its_value_can_be_said_and_nothing_else(served: Served, updates: dict[str, Any]) -> None:
    assert said(served, f"/{TOKEN}", served.update(**updates)) == []
    assert said(served, "/", served.update(value=True)) == ["box"]


@pytest.mark.parametrize("nonsense", ["text", b"", b"\xff", msgspec.msgpack.encode({"type": "No"}), b"x" * 70_000])
def test_nonsense_ends_the_connection_that_says_it(
    served: Served, nonsense: str | bytes, capfd: pytest.CaptureFixture[str]
) -> None:
    async def speak() -> int | None:
        async with served.guest() as guest:
            await guest.send(nonsense)
            await asyncio.wait_for(guest.wait_closed(), 5)
            return guest.close_code

    assert asyncio.run(speak()) in {1008, 1009}
    assert "Traceback" not in capfd.readouterr().err


@pytest.mark.parametrize(
    ("host", "origin", "may"),
    [
        ("{place}", None, True),
        ("{place}", "http://{place}", True),
        ("localhost:{port}", "http://localhost:{port}", True),
        ("{place}", "http://localhost:{port}", True),
        ("{place}", "http://localhost:1", False),
        ("{place}", "https://elsewhere.example", False),
        ("{place}", "null", False),
        ("{place}", "http://[", False),
        ("elsewhere.example:{port}", "http://elsewhere.example:{port}", False),
        ("elsewhere.example", None, False),
    ],
)
def test_pages_of_others_may_not_look(served: Served, host: str, origin: str | None, may: bool) -> None:
    port = served.place.rpartition(":")[2]
    lines = [f"Host: {host.format(place=served.place, port=port)}"]
    if origin is not None:
        lines.append(f"Origin: {origin.format(place=served.place, port=port)}")
    with socket.create_connection((served.host, int(port)), timeout=5) as link:
        link.sendall("\r\n".join(["GET / HTTP/1.1", *lines, "", ""]).encode())
        answer = link.recv(4096).split(b"\r\n")[0]
    assert answer == (b"HTTP/1.1 200 OK" if may else b"HTTP/1.1 403 Forbidden")


def test_who_talks_without_end_is_heard_slowly_and_holds_nobody_up() -> None:
    # A server of its own: what the talker has sent is still being heard when the test is over.
    served = Served(own_host())

    async def speak() -> None:
        count = 3 * int(LOOKERS_MESSAGES_PER_S)
        async with served.guest() as talker:
            served.heard.clear()
            flood = asyncio.create_task(say(talker, CAMERA, *(served.update(value=bool(n % 2)) for n in range(count))))
            async with served.guest(f"/{TOKEN}") as operator:
                await say(operator, CAMERA, served.hold())
                while "hold" not in served.heard:
                    await asyncio.wait([flood], timeout=0.01)
            assert len(served.heard) < 0.8 * count
            flood.cancel()

    try:
        asyncio.run(speak())
    finally:
        served.server.stop()


def test_lookers_do_not_keep_the_operator_out(served: Served) -> None:
    async def come() -> None:
        async with contextlib.AsyncExitStack() as stack:
            guests = [await stack.enter_async_context(served.guest()) for _ in range(MAX_LOOKERS + 1)]
            await asyncio.wait_for(guests[-1].wait_closed(), 5)
            assert guests[-1].close_reason == f"{MAX_LOOKERS} browsers are here already, which is the most"
            operator = await stack.enter_async_context(served.guest(f"/{TOKEN}"))
            await asyncio.wait_for(operator.recv(), 5)

    asyncio.run(come())


@pytest.mark.parametrize("host", ["192.0.2.1", "no such name"])
def test_a_place_that_cannot_be_is_refused(host: str) -> None:
    with pytest.raises(EndpointError, match=f"cannot serve the page at {host}:8080: "):
        first_free_port(host, 8080)


def test_the_next_port_is_taken_and_none_after_the_last() -> None:
    host = own_host()
    with socket.create_server((host, 65535)):
        with pytest.raises(EndpointError, match="all ports from 65535 to 65535"):
            first_free_port(host, 65535)
        with socket.create_server((host, 65533)):
            assert first_free_port(host, 65533) == 65534
