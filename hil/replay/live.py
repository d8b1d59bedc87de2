"""Sockets and time for the stand-ins: one side of a recorded conversation against the living other one."""

import select
import socket
from contextlib import suppress
from pathlib import Path
from typing import Final

from hil.clock import Deadline, MonotonicClock
from hil.replay.conversations import fri_conversation, servo_conversation
from hil.replay.replay import Wish, packets_of
from hil.replay.result import ReplayResult
from hil.replay.stand_in_application import RecordedApplication
from hil.replay.stand_in_client import RecordedClient
from hil.replay.stand_in_controller import RecordedController
from hil.replay.stand_in_servo import RecordedServoController
from hil.values.errors import EndpointError
from hil.values.link import Address
from hil.values.servo import SERVO_PORT
from transport.servo import ServoCodec
from transport.udp import ANY_HOST, bind_socket, parse_address

_MOST_BYTES: Final = 1501
_LAST_ANSWERS_S: Final = 0.2
_SILENCE_S: Final = 10.0


def client_against_controller(file: Path, wish: Wish, *, bind: Address, duration_s: float | None) -> RecordedClient:
    """Answer the controller that speaks to ``bind`` as the recorded FRI client did, until the end of either."""
    flow = fri_conversation(file, wish)
    client = RecordedClient(flow, packets_of(file))
    duration, silence = Deadline(duration_s), Deadline(_SILENCE_S)
    with _socket(bind) as sock:
        while not client.ended:
            left = _earliest(duration, silence)
            if left is not None and left <= 0:
                break
            arrived = _next_datagram(sock, left)
            if arrived is None:
                continue
            silence.restart()
            answer = client.receive(arrived[0])
            if answer is not None:
                _send(sock, answer, arrived[1])
    if not client.received:
        raise EndpointError(f"no monitoring message of release {flow.release} came to {bind} within {_SILENCE_S:g} s")
    return client


def controller_against_client(
    file: Path, wish: Wish, *, client: Address, bind: Address
) -> tuple[RecordedController, ReplayResult]:
    """Speak to the FRI client at ``client`` as the recorded controller did, and compare its answers."""
    flow = fri_conversation(file, wish)
    result = ReplayResult(str(file), own=True, other="client", complete=True)
    controller = RecordedController(flow, packets_of(file), result)
    clock = MonotonicClock()
    began_ns = clock.now_ns()
    with _socket(bind) as sock:
        for t_ns, datagram in controller.messages():
            while (left_ns := began_ns + t_ns - clock.now_ns()) > 0:
                arrived = _next_datagram(sock, left_ns * 1e-9)
                if arrived is not None and arrived[1] == client:
                    controller.receive(arrived[0])
            _send(sock, datagram, client)
        last = Deadline(_LAST_ANSWERS_S)
        while (left := last.left_s()) is not None and left > 0:
            arrived = _next_datagram(sock, left)
            if arrived is not None and arrived[1] == client:
                controller.receive(arrived[0])
    controller.finish()
    result.took_s = (clock.now_ns() - began_ns) / 1e9
    return controller, result


def application_against_controller(file: Path, *, controller: Address, codec: ServoCodec) -> RecordedApplication:
    """Speak to the controller at ``controller`` as the first recorded application did, until the end of either."""
    recorded_client, recorded_controller = servo_conversation(file, codec)
    application = RecordedApplication(
        packets_of(file), client=recorded_client, controller=recorded_controller, codec=codec
    )
    clock, silence = MonotonicClock(), Deadline(_SILENCE_S)
    with _socket(Address(ANY_HOST, 0)) as sock:
        while not application.over:
            for datagram in application.due(now_ns=clock.now_ns()):
                _send(sock, datagram, controller)
            due_ns = application.next_due_ns()
            if due_ns is None:
                break
            left = silence.left_s() or 0.0
            if left <= 0:
                raise EndpointError(f"nothing came from the controller at {controller} for {_SILENCE_S:g} s")
            arrived = _next_datagram(sock, min(left, max(0.0, (due_ns - clock.now_ns()) * 1e-9)))
            if arrived is not None and arrived[1] == controller:
                silence.restart()
                application.receive(arrived[0], now_ns=clock.now_ns())
    return application


def controller_against_application(
    file: Path, *, bind: Address, codec: ServoCodec
) -> tuple[RecordedServoController, ReplayResult]:
    """Speak to the application that connects to ``bind`` as the recorded controller did; compare what it asks for."""
    recorded_client, recorded_controller = servo_conversation(file, codec)
    result = ReplayResult(str(file), own=True, other="application", complete=True)
    controller = RecordedServoController(
        packets_of(file), client=recorded_client, controller=recorded_controller, codec=codec, result=result
    )
    clock, silence = MonotonicClock(), Deadline(_SILENCE_S)
    with _socket(bind) as sock:
        while not controller.over and not controller.left:
            left = silence.left_s() or 0.0
            if left <= 0:
                break
            due_ns = controller.next_due_ns()
            if due_ns is not None:
                left = min(left, max(0.0, (due_ns - clock.now_ns()) * 1e-9))
            arrived = _next_datagram(sock, left)
            if arrived is not None:
                silence.restart()
                answer = controller.receive(*arrived, now_ns=clock.now_ns())
                if answer is not None:
                    _send(sock, answer, arrived[1])
            if controller.peer is not None:
                for datagram in controller.due(now_ns=clock.now_ns()):
                    _send(sock, datagram, controller.peer)
    controller.finish()
    if controller.peer is None:
        raise EndpointError(f"no application said hello at {bind} within {_SILENCE_S:g} s")
    return controller, result


def controller_address(text: str) -> Address:
    """Return the address of a controller's servo link, ``HOST[:PORT]``."""
    return parse_address(text, default_port=SERVO_PORT)


def _socket(bind: Address) -> socket.socket:
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        bind_socket(sock, bind, in_use="; another program holds that port: end it, or choose another one")
        sock.setblocking(False)
    except BaseException:
        sock.close()
        raise
    return sock


def _next_datagram(sock: socket.socket, timeout_s: float | None) -> tuple[bytes, Address] | None:
    # select, not epoll, which rounds timeouts up to whole milliseconds
    if not select.select([sock], [], [], timeout_s)[0]:
        return None
    try:
        datagram, sender = sock.recvfrom(_MOST_BYTES)
    except OSError:
        return None
    return datagram, Address(*sender)


def _send(sock: socket.socket, datagram: bytes, destination: Address) -> None:
    with suppress(ConnectionRefusedError, BlockingIOError):
        sock.sendto(datagram, destination)


def _earliest(*deadlines: Deadline) -> float | None:
    left = [seconds for deadline in deadlines if (seconds := deadline.left_s()) is not None]
    return min(left, default=None)
