"""Both shells on loopback, against a controller that is a socket and a script."""

import asyncio
import gc
import signal
import socket
from collections.abc import Iterator

import pytest

from hil.client.fri import (
    AsyncFriClient,
    EndpointError,
    FriClient,
    FriHandler,
    FriState,
    NothingHeard,
    Release,
    SessionState,
    UsageError,
)
from tests.unit.test_client_support import datagram, read

HOST = "127.0.0.1"
ORDER = (
    SessionState.MONITORING_WAIT,
    SessionState.MONITORING_READY,
    SessionState.COMMANDING_WAIT,
    SessionState.COMMANDING_ACTIVE,
    SessionState.IDLE,
)
SCRIPT = list(enumerate(ORDER))
SILENCE_S = 0.02


class Interrupting(FriHandler):
    """Presses Ctrl-C in the first callback."""

    def monitor(self, state: FriState) -> None:
        signal.raise_signal(signal.SIGINT)


@pytest.fixture
def controller() -> Iterator[socket.socket]:
    """A controller's socket on a free port."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind((HOST, 0))
        sock.settimeout(10)
        yield sock
    # A socket somebody forgot would warn now, in the test that forgot it.
    gc.collect()


def play(controller: socket.socket, client: tuple[str, int], release: Release) -> None:
    """Send a whole session; the kernel keeps it until the client reads."""
    for sequence, state in SCRIPT:
        controller.sendto(datagram(release, state, sequence=sequence), client)


def heard(controller: socket.socket, release: Release) -> list[tuple[int, int]]:
    """Return counters of the answers to a whole session."""
    return [read(release, controller.recv(2048))[:2] for _ in ORDER[:-1]]


def port_of(sock: socket.socket) -> int:
    port: int = sock.getsockname()[1]
    return port


@pytest.mark.parametrize("release", Release)
@pytest.mark.parametrize("connected", [False, True])
def test_blocking_client_answers_a_session_to_its_end(
    controller: socket.socket, release: Release, connected: bool
) -> None:
    host = f"{HOST}:{port_of(controller)}" if connected else None
    with FriClient(FriHandler(), release=release, port=0, bind_host=HOST, controller=host) as client:
        play(controller, client.local, release)
        client.run()
        assert client.session.ended
    assert heard(controller, release) == [(0, 0), (1, 1), (2, 2), (3, 3)]


@pytest.mark.parametrize("release", Release)
@pytest.mark.parametrize("connected", [False, True])
async def test_asyncio_client_answers_a_session_to_its_end(
    controller: socket.socket, release: Release, connected: bool
) -> None:
    host = f"{HOST}:{port_of(controller)}" if connected else None
    async with AsyncFriClient(FriHandler(), release=release, port=0, bind_host=HOST, controller=host) as client:
        play(controller, client.local, release)
        await client.run()
        assert client.session.ended
    assert heard(controller, release) == [(0, 0), (1, 1), (2, 2), (3, 3)]


def test_a_second_run_serves_the_next_session(controller: socket.socket) -> None:
    with FriClient(FriHandler(), release=Release.V1_15, port=0, bind_host=HOST) as client:
        for _ in range(2):
            play(controller, client.local, Release.V1_15)
            client.run()
        assert (client.session.received, client.session.answered) == (10, 8)


def test_blocking_run_ends_on_duration_and_on_silence(controller: socket.socket) -> None:
    with FriClient(FriHandler(), release=Release.V1_15, port=0, bind_host=HOST) as client:
        for duration_s, silence_s in ((SILENCE_S, None), (None, SILENCE_S), (60, SILENCE_S)):
            with pytest.raises(NothingHeard, match="no datagram came"):
                client.run(duration_s=duration_s, silence_s=silence_s)
        assert not client.step(SILENCE_S)
        controller.sendto(datagram(Release.V1_15, SessionState.MONITORING_WAIT), client.local)
        controller.sendto(b"no message", client.local)
        client.run(silence_s=SILENCE_S)
        assert (client.session.received, client.session.malformed.total()) == (1, 1)


def test_datagrams_of_another_release_are_named_when_nothing_else_came(controller: socket.socket) -> None:
    with FriClient(FriHandler(), release=Release.V1_15, port=0, bind_host=HOST) as client:
        controller.sendto(datagram(Release.V2_7, SessionState.MONITORING_WAIT), client.local)
        with pytest.raises(NothingHeard, match=r"no datagram was .* of release 1\.15: 1 other_release"):
            client.run(silence_s=SILENCE_S)


async def test_asyncio_run_ends_on_duration_and_on_silence(controller: socket.socket) -> None:
    async with AsyncFriClient(FriHandler(), release=Release.V1_15, port=0, bind_host=HOST) as client:
        for duration_s, silence_s in ((SILENCE_S, None), (None, SILENCE_S), (60, SILENCE_S)):
            with pytest.raises(NothingHeard, match="no datagram came"):
                await client.run(duration_s=duration_s, silence_s=silence_s)
        assert not await client.step(SILENCE_S)
        controller.sendto(datagram(Release.V1_15, SessionState.MONITORING_WAIT), client.local)
        controller.sendto(b"no message", client.local)
        await client.run(silence_s=SILENCE_S)
        assert (client.session.received, client.session.malformed.total()) == (1, 1)


def test_a_taken_port_is_one_sentence(controller: socket.socket) -> None:
    client = FriClient(FriHandler(), release=Release.V1_15, port=port_of(controller), bind_host=HOST)
    with pytest.raises(
        EndpointError, match=r"^cannot bind UDP 127\.0\.0\.1:\d+: Address already in use; [^.]* port(?:; process .*)?$"
    ):
        client.__enter__()
    with pytest.raises(UsageError, match="not open"):
        client.step(0)


async def test_a_taken_port_is_one_sentence_in_asyncio_too(controller: socket.socket) -> None:
    client = AsyncFriClient(FriHandler(), release=Release.V1_15, port=port_of(controller), bind_host=HOST)
    with pytest.raises(
        EndpointError, match=r"^cannot bind UDP 127\.0\.0\.1:\d+: Address already in use; [^.]* port(?:; process .*)?$"
    ):
        await client.__aenter__()
    with pytest.raises(UsageError, match="not open"):
        await client.step(0)


@pytest.mark.parametrize("port", [-1, 65536])
def test_a_port_that_is_none(port: int) -> None:
    with pytest.raises(UsageError, match=r"outside 0\.\.65535"):
        FriClient(FriHandler(), release=Release.V1_15, port=port).__enter__()


def test_a_controller_that_is_none_leaves_no_socket_open() -> None:
    client = FriClient(FriHandler(), release=Release.V1_15, port=0, bind_host=HOST, controller="127.0.0.1:x")
    with pytest.raises(UsageError, match="'x' is no number"):
        client.__enter__()
    client.close()
    gc.collect()


def test_the_controllers_port_is_the_clients_own_unless_given(controller: socket.socket) -> None:
    port = port_of(controller)
    with (
        FriClient(
            FriHandler(), release=Release.V2_7, port=port, bind_host="127.0.77.1", controller="127.0.0.1"
        ) as client,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger,
    ):
        stranger.bind((HOST, 0))
        stranger.sendto(datagram(Release.V2_7, SessionState.MONITORING_WAIT, sequence=1), client.local)
        controller.sendto(datagram(Release.V2_7, SessionState.MONITORING_WAIT, sequence=2), client.local)
        assert client.step(10)
        assert read(Release.V2_7, controller.recv(2048))[:2] == (0, 2)


def test_the_answer_goes_to_the_sender_of_the_last_message(controller: socket.socket) -> None:
    with (
        FriClient(FriHandler(), release=Release.V2_5, port=0, bind_host=HOST) as client,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as second,
    ):
        second.settimeout(10)
        for sequence, sender in enumerate((controller, second, controller)):
            sender.sendto(datagram(Release.V2_5, SessionState.MONITORING_WAIT, sequence=sequence), client.local)
            assert client.step(10)
            assert read(Release.V2_5, sender.recv(2048))[:2] == (sequence, sequence)


def test_a_controller_that_vanishes_ends_the_blocking_run(controller: socket.socket) -> None:
    host = f"{HOST}:{port_of(controller)}"
    with FriClient(FriHandler(), release=Release.V1_16, port=0, bind_host=HOST, controller=host) as client:
        for sequence in range(3):
            controller.sendto(datagram(Release.V1_16, ORDER[0], sequence=sequence), client.local)
        controller.close()
        client.run(silence_s=SILENCE_S)
        assert client.session.answered == 3
        assert not client.session.ended


async def test_a_controller_that_vanishes_ends_the_asyncio_run(controller: socket.socket) -> None:
    host = f"{HOST}:{port_of(controller)}"
    async with AsyncFriClient(FriHandler(), release=Release.V1_16, port=0, bind_host=HOST, controller=host) as client:
        for sequence in range(3):
            controller.sendto(datagram(Release.V1_16, ORDER[0], sequence=sequence), client.local)
        controller.close()
        await client.run(silence_s=SILENCE_S)
        assert client.session.answered == 3


def test_a_late_report_of_a_refused_answer_does_not_lose_the_next_one(controller: socket.socket) -> None:
    release = Release.V1_15
    host = (HOST, port_of(controller))

    class Restarting(FriHandler):
        """While the client computes an answer, the controller goes away, refuses a datagram, and comes back."""

        def monitor(self, state: FriState) -> None:
            controller.close()
            client._open().send(b"refused")
            again.bind(host)

    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as again,
        FriClient(Restarting(), release=release, port=0, bind_host=HOST, controller=f"{HOST}:{host[1]}") as client,
    ):
        again.settimeout(10)
        controller.sendto(datagram(release, ORDER[0]), client.local)
        assert client.step(10)
        assert read(release, again.recv(2048))[:2] == (0, 0)


def test_ctrl_c_ends_the_blocking_run_and_closes_the_socket(controller: socket.socket) -> None:
    client = FriClient(Interrupting(), release=Release.V1_15, port=0, bind_host=HOST)

    def main() -> None:
        with client:
            controller.sendto(datagram(Release.V1_15, ORDER[0]), client.local)
            client.run()

    with pytest.raises(KeyboardInterrupt):
        main()
    with pytest.raises(UsageError, match="not open"):
        _ = client.local


def test_ctrl_c_ends_the_asyncio_run_and_closes_the_socket(controller: socket.socket) -> None:
    client = AsyncFriClient(Interrupting(), release=Release.V1_15, port=0, bind_host=HOST)

    async def main() -> None:
        async with client:
            controller.sendto(datagram(Release.V1_15, ORDER[0]), client.local)
            await client.run()

    with pytest.raises(KeyboardInterrupt):
        asyncio.run(main())
    with pytest.raises(UsageError, match="not open"):
        _ = client.local


async def test_the_port_is_free_again_after_the_asyncio_client(controller: socket.socket) -> None:
    async with AsyncFriClient(FriHandler(), release=Release.V1_15, port=0, bind_host="127.0.77.2") as first:
        local = first.local
    async with AsyncFriClient(FriHandler(), release=Release.V1_15, port=local.port, bind_host=local.host) as second:
        assert second.local == local


async def test_closing_ends_a_waiting_step() -> None:
    async with AsyncFriClient(FriHandler(), release=Release.V1_15, port=0, bind_host=HOST) as client:
        step = asyncio.create_task(client.step())
        asyncio.get_running_loop().call_soon(asyncio.ensure_future, client.close())
        with pytest.raises(UsageError, match="not open"):
            await step
