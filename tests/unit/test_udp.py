"""Endpoints: one peer, strangers heard apart; many peers, one of them gone; ports that clash named."""

import asyncio
import contextlib
import itertools
import socket
import sys

import pytest

from hil.clock import let_others_run, unix_time_ns
from hil.values.errors import ConfigurationError, EndpointError
from hil.values.link import Address
from tests.support.processes import own_host
from transport import udp as udp_endpoints
from transport.udp import (
    MOST_UNTAKEN,
    SERVER_DATAGRAMS_AT_ONCE,
    EndpointClosed,
    PeerEndpoint,
    ServerEndpoint,
    default_bind,
    is_local,
    open_peer_endpoint,
    open_server_endpoint,
    parse_address,
    refuse_shared_port,
)


def udp(host: str) -> socket.socket:
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.bind((host, 0))
    sock.setblocking(False)
    return sock


def address_of(sock: socket.socket) -> Address:
    return Address(*sock.getsockname())


async def stamped_in_time(peer: socket.socket, endpoint: PeerEndpoint | ServerEndpoint) -> bool:
    """Whether a datagram's stamp is of when it was sent, before anybody read it.

    The kernel begins to stamp a moment after it was asked to; until then it says when it was read.
    """
    before_ns = unix_time_ns()
    peer.sendto(b"in time", endpoint.local)
    sent_ns = unix_time_ns()
    async with asyncio.timeout(5):
        arrival = await endpoint.receive()
    assert arrival.at_unix_ns is not None
    return before_ns <= arrival.at_unix_ns <= sent_ns


async def test_the_peer_and_strangers_are_heard_apart() -> None:
    host = own_host()
    with udp(host) as peer, udp(host) as stranger:
        endpoint = await open_peer_endpoint(bind=Address(host, 0), peer=address_of(peer))
        for number in range(5):
            stranger.sendto(b"stranger %d" % number, endpoint.local)
            peer.sendto(b"peer %d" % number, endpoint.local)
        async with asyncio.timeout(5):
            answers = [await endpoint.receive() for _ in range(5)]
            heard = [await endpoint.receive_stranger() for _ in range(5)]
        assert [arrival.datagram for arrival in answers] == [b"peer %d" % number for number in range(5)]
        assert {arrival.sender for arrival in answers} == {address_of(peer)}
        assert {arrival.sender for arrival in heard} == {address_of(stranger)}
        await endpoint.send(b"hello")
        assert await asyncio.get_running_loop().sock_recv(peer, 100) == b"hello"
        with pytest.raises(BlockingIOError):
            stranger.recv(100)
        endpoint.close()
        endpoint.close()
        with pytest.raises(EndpointClosed):
            await endpoint.send(b"too late")


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells when the kernel got a datagram")
async def test_the_kernel_says_when_a_datagram_came_however_late_it_is_read() -> None:
    host = own_host()
    with udp(host) as peer:
        endpoint = await open_peer_endpoint(bind=Address(host, 0), peer=address_of(peer))
        async with asyncio.timeout(10):
            while not await stamped_in_time(peer, endpoint):
                pass
        stamped = [await stamped_in_time(peer, endpoint) for _ in range(5)]
        endpoint.close()
    assert all(stamped)


async def test_nobody_listening_is_counted_and_every_datagram_is_still_sent() -> None:
    host = own_host()
    with udp(host) as gone:
        peer = address_of(gone)
    endpoint = await open_peer_endpoint(bind=Address(host, 0), peer=peer)
    for _ in range(20):
        await endpoint.send(b"anybody?")
        await asyncio.get_running_loop().run_in_executor(None, lambda: None)
    assert endpoint.refused >= 15
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as back:
        back.bind(peer)
        back.settimeout(5)
        await endpoint.send(b"first")
        await endpoint.send(b"second")
        assert [back.recv(100), back.recv(100)] == [b"first", b"second"]
    endpoint.close()


async def test_closing_wakes_the_listeners() -> None:
    host = own_host()
    with udp(host) as peer:
        endpoint = await open_peer_endpoint(bind=Address(host, 0), peer=address_of(peer))
        listening = [asyncio.ensure_future(endpoint.receive()), asyncio.ensure_future(endpoint.receive_stranger())]
        asyncio.get_running_loop().call_soon(endpoint.close)
        for listener in listening:
            with pytest.raises(EndpointError, match="is closed"):
                await listener


async def test_a_bound_port_cannot_be_had_twice() -> None:
    host = own_host()
    with udp(host) as peer:
        endpoint = await open_peer_endpoint(bind=Address(host, 0), peer=address_of(peer))
        with pytest.raises(EndpointError, match="Address already in use"):
            await open_peer_endpoint(bind=endpoint.local, peer=address_of(peer))
        endpoint.close()


async def test_a_server_hears_everybody_and_answers_each() -> None:
    host = own_host()
    endpoint = await open_server_endpoint(Address(host, 0))
    assert endpoint.local.host == host
    with udp(host) as one, udp(host) as two:
        for number in range(5):
            one.sendto(b"one %d" % number, endpoint.local)
            two.sendto(b"two %d" % number, endpoint.local)
        async with asyncio.timeout(5):
            arrivals = [await endpoint.receive() for _ in range(10)]
        for peer, name in ((one, b"one"), (two, b"two")):
            heard = [arrival.datagram for arrival in arrivals if arrival.sender == address_of(peer)]
            assert heard == [b"%b %d" % (name, number) for number in range(5)]
            await endpoint.send(name, address_of(peer))
            assert peer.recvfrom(100) == (name, endpoint.local)
    endpoint.close()


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells when the kernel got a datagram")
async def test_a_server_reads_a_few_datagrams_a_pass_and_leaves_the_rest_to_the_kernel() -> None:
    host = own_host()
    endpoint = await open_server_endpoint(Address(host, 0))
    with udp(host) as peer:
        for number in range(3 * SERVER_DATAGRAMS_AT_ONCE):
            peer.sendto(b"%d" % number, endpoint.local)
        heard: list[bytes] = []

        async def listen() -> None:
            while True:
                heard.append((await endpoint.receive()).datagram)

        listener = asyncio.create_task(listen())
        counts = []
        async with asyncio.timeout(5):
            while len(heard) < 3 * SERVER_DATAGRAMS_AT_ONCE:
                await let_others_run(1)
                counts.append(len(heard))
        listener.cancel()
    endpoint.close()
    assert heard == [b"%d" % number for number in range(3 * SERVER_DATAGRAMS_AT_ONCE)]
    assert max(later - earlier for earlier, later in itertools.pairwise([0, *counts])) == SERVER_DATAGRAMS_AT_ONCE


async def test_a_server_is_told_when_the_kernel_got_a_datagram() -> None:
    host = own_host()
    endpoint = await open_server_endpoint(Address(host, 0))
    with udp(host) as peer:
        stamped = [await stamped_in_time(peer, endpoint) for _ in range(10)]
    endpoint.close()
    assert all(stamped[3:])


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells an unconnected socket that nobody listens")
async def test_a_peer_that_is_gone_is_counted_and_the_others_miss_nothing() -> None:
    host = own_host()
    endpoint = await open_server_endpoint(Address(host, 0))
    with udp(host) as gone:
        nobody = address_of(gone)
    with udp(host) as peer:
        peer.sendto(b"hello", endpoint.local)
        async with asyncio.timeout(5):
            assert (await endpoint.receive()).datagram == b"hello"
        for number in range(20):
            await endpoint.send(b"anybody?", nobody)
            await endpoint.send(b"%d" % number, address_of(peer))
            if number % 2:
                await asyncio.get_running_loop().run_in_executor(None, lambda: None)
        assert [peer.recv(100) for _ in range(20)] == [b"%d" % number for number in range(20)]
        assert 15 <= endpoint.refused <= 20
        peer.sendto(b"still there", endpoint.local)
        async with asyncio.timeout(5):
            assert (await endpoint.receive()).datagram == b"still there"
    endpoint.close()


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux keeps the answers")
async def test_an_answer_that_nobody_fetches_does_not_keep_the_loop_busy() -> None:
    host = own_host()
    endpoint = await open_server_endpoint(Address(host, 0))
    with udp(host) as gone:
        nobody = address_of(gone)
    listening = asyncio.ensure_future(endpoint.receive())
    await endpoint.send(b"anybody?", nobody)
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(5):
            while endpoint.refused == 0:
                await asyncio.get_running_loop().run_in_executor(None, lambda: None)
    assert endpoint.refused == 1
    with pytest.raises(BlockingIOError):
        endpoint._channel._socket.recvmsg(0, 0, socket.MSG_ERRQUEUE)
    endpoint.close()
    with pytest.raises(EndpointClosed):
        await listening


async def test_a_destination_without_a_way_is_counted() -> None:
    endpoint = await open_server_endpoint(Address(own_host(), 0))
    # A loopback address cannot be the source of what leaves the machine, and port 0 is nobody's.
    for destination in (Address("192.0.2.1", 30300), Address(endpoint.local.host, 0)):
        before = endpoint.refused
        await endpoint.send(b"hello", destination)
        assert endpoint.refused == before + 1
    endpoint.close()


async def test_a_closed_server_says_so() -> None:
    endpoint = await open_server_endpoint(Address(own_host(), 0))
    listening = asyncio.ensure_future(endpoint.receive())
    asyncio.get_running_loop().call_soon(endpoint.close)
    with pytest.raises(EndpointError, match="is closed"):
        await listening
    endpoint.close()
    for _ in range(2):
        with pytest.raises(EndpointClosed):
            await endpoint.send(b"too late", endpoint.local)
        with pytest.raises(EndpointClosed):
            await endpoint.receive()
    again = await open_server_endpoint(endpoint.local)
    again.close()


async def test_a_second_server_is_told_how_to_choose_another_address() -> None:
    first = await open_server_endpoint(Address(own_host(), 0))
    with pytest.raises(EndpointError, match=r"Address already in use.*hil run.*--servo ADDR:PORT"):
        await open_server_endpoint(first.local)
    first.close()
    with pytest.raises(EndpointError, match=r"cannot bind UDP 192\.0\.2\.1:30300"):
        await open_server_endpoint(Address("192.0.2.1", 30300))


async def test_an_address_that_is_not_ours_is_named() -> None:
    with pytest.raises(EndpointError, match=r"cannot bind UDP 192\.0\.2\.1:30200"):
        await open_peer_endpoint(bind=Address("192.0.2.1", 30200), peer=Address("127.0.0.1", 30201))


def test_a_client_needs_a_port() -> None:
    with pytest.raises(ConfigurationError, match=r"the client at 127\.0\.0\.1:0 needs a port of its own"):
        refuse_shared_port(bind=Address("127.0.0.2", 30200), peer=Address("127.0.0.1", 0))


def test_a_port_is_not_shared_with_a_client_on_this_machine() -> None:
    for host in ("0.0.0.0", "127.0.0.1"):  # noqa: S104
        with pytest.raises(ConfigurationError, match="cannot bind"):
            refuse_shared_port(bind=Address(host, 30200), peer=Address("127.0.0.1", 30200))
    refuse_shared_port(bind=Address("127.0.0.2", 30200), peer=Address("127.0.0.1", 30200))
    refuse_shared_port(bind=Address("0.0.0.0", 30201), peer=Address("127.0.0.1", 30200))  # noqa: S104
    refuse_shared_port(bind=Address("0.0.0.0", 30200), peer=Address("192.0.2.1", 30200))  # noqa: S104


def test_defaults_and_addresses() -> None:
    assert is_local("127.0.0.77")
    assert not is_local("192.0.2.1")
    assert default_bind(Address("127.0.0.5", 30200)) == Address("127.0.0.5", 0)
    assert parse_address("127.0.0.9", default_port=30200) == Address("127.0.0.9", 30200)
    assert parse_address("localhost:7", default_port=30200) == Address("127.0.0.1", 7)
    for text in ("127.0.0.1:x", "127.0.0.1:3_0", "127.0.0.1:99999", "no.such.host.invalid", "a" * 300):
        with pytest.raises(ConfigurationError, match=text[:20]):
            parse_address(text, default_port=1)


async def test_what_nobody_takes_is_bounded_counted_and_does_not_hide_the_end() -> None:
    with udp(own_host()) as stranger:
        endpoint = await open_server_endpoint(Address(own_host(), 0))
        for number in range(MOST_UNTAKEN + 40):
            stranger.sendto(number.to_bytes(2, "big"), endpoint.local)
            # A pass of the event loop for each: the kernel's buffer is not what bounds it.
            await let_others_run(1)
        await let_others_run(8)
        assert endpoint.untaken == 40
        taken = [int.from_bytes((await endpoint.receive()).datagram, "big") for _ in range(MOST_UNTAKEN - 1)]
        assert taken == list(range(MOST_UNTAKEN - 1))
        stranger.sendto(b"there is room again", endpoint.local)
        await let_others_run(8)
        assert (await endpoint.receive()).datagram == (MOST_UNTAKEN - 1).to_bytes(2, "big")
        assert (await endpoint.receive()).datagram == b"there is room again"
        for _ in range(MOST_UNTAKEN):
            stranger.sendto(b"full", endpoint.local)
            await let_others_run(1)
        waiting = asyncio.ensure_future(endpoint.receive())
        endpoint.close()
        with contextlib.suppress(EndpointClosed):
            await waiting
        with pytest.raises(EndpointClosed):
            await endpoint.receive()


async def test_a_second_socket_that_cannot_be_read_closes_the_first(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[udp_endpoints._Channel] = []
    whole = udp_endpoints._open_channel

    async def fails_second(sock: socket.socket) -> udp_endpoints._Channel:
        if opened:
            raise OSError("no descriptor is left")
        opened.append(await whole(sock))
        return opened[0]

    monkeypatch.setattr(udp_endpoints, "_open_channel", fails_second)
    host = own_host()
    with udp(host) as peer:
        with pytest.raises(OSError, match="no descriptor"):
            await open_peer_endpoint(bind=Address(host, 0), peer=address_of(peer))
        with pytest.raises(EndpointClosed):
            await opened[0].receive()
