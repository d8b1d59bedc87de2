"""Programs as they were published, against hil run --kst with a MuJoCo arm: all of them in a row, without a restart."""

import re
import signal
from collections.abc import Iterator

import pytest

from tests.support.processes import finish, hil, own_host, wait_for_line
from tests.support.published_kst import PublishedClient

HASTE = 10.0
STREAM_S = 1.0
RATE_HZ = 20.0
"""Of a busy machine; hil bench kst measures it."""


@pytest.fixture(scope="module")
def address() -> Iterator[tuple[str, int]]:
    """One controller for all of them."""
    host = own_host()
    process = hil("run", "--fri-client", "off", "--servo", f"{host}:0", "--kst", f"{host}:0", "--progress", 0)
    try:
        found = re.search(r"KST programs at TCP ([\d.]+):(\d+)", wait_for_line(process, "KST programs at TCP")[-1])
        assert found is not None
        yield found[1], int(found[2])
    finally:
        process.send_signal(signal.SIGINT)
        assert finish(process).code == 0


def in_step(client: PublishedClient) -> None:
    """Every reply was the one that was expected."""
    assert client.unexpected == []


def test_getters(address: tuple[str, int]) -> None:
    with PublishedClient(address, HASTE) as client:
        found = client.getters()
        in_step(client)
    assert found["pose"][2] == pytest.approx(1139.5, abs=0.5)
    assert found["joints"] == pytest.approx([0.0, 0.5236, 0.0, 0.6981, 0.0, 1.5708, 0.0], abs=1e-3)
    assert abs(found["measured"][1]) > 10.0


def test_ptp_motion_with_a_tool(address: tuple[str, int]) -> None:
    with PublishedClient(address, HASTE) as client:
        seen = client.ptp_motion(tool="50_25_0_0_0_0")
        in_step(client)
    # Lines there and back; round a circle all but a fiftieth of it, of 50 mm.
    assert seen[1][:3] == pytest.approx(seen[0][:3], abs=0.5)
    assert seen[3][:2] == pytest.approx([seen[2][0] - 0.1, seen[2][1] - 3.14], abs=0.6)


def test_direct_servo_joints(address: tuple[str, int]) -> None:
    with PublishedClient(address, HASTE) as client:
        assert client.direct_servo_joints(STREAM_S) > RATE_HZ
        in_step(client)


@pytest.mark.parametrize("token", ["DcSeCarExT", "DcSeCarJP", "DcSeCarMT"])
def test_direct_servo_cartesian(address: tuple[str, int], token: str) -> None:
    with PublishedClient(address, HASTE) as client:
        assert client.direct_servo_cartesian(STREAM_S, token) > RATE_HZ
        in_step(client)


def test_impedance(address: tuple[str, int]) -> None:
    with PublishedClient(address, HASTE) as client:
        assert client.impedance(STREAM_S) > RATE_HZ
    # A published client does not read the second acknowledgement of a stop, and is a reply behind from then on.
    assert all(b"done\n" in reply for _, reply in client.unexpected)


def test_impedance_with_feedback(address: tuple[str, int]) -> None:
    with PublishedClient(address, HASTE) as client:
        assert client.impedance_with_feedback(STREAM_S) > RATE_HZ
        in_step(client)
