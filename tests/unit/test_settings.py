"""Impossible pairings end in one sentence."""

import pytest

from hil.core.settings import ControllerSettings, FriSettings
from hil.values.errors import ConfigurationError
from hil.values.fri import OperationMode
from hil.values.link import Address

PEER = Address("127.0.0.1", 30200)


def controller(cycle_ms: int, fri: FriSettings | None = None) -> ControllerSettings:
    return ControllerSettings(operation_mode=OperationMode.T1, cycle_ms=cycle_ms, unix_epoch_ns=0, fri=fri)


@pytest.mark.parametrize("cycle_ms", [1, 2, 4, 5])
@pytest.mark.parametrize("periods", [1, 3, 20])
def test_whole_multiples_are_taken(cycle_ms: int, periods: int) -> None:
    settings = controller(cycle_ms, FriSettings(peer=PEER, send_period_ms=cycle_ms * periods))
    assert settings.cycle_ns == cycle_ms * 1_000_000


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: FriSettings(peer=PEER, send_period_ms=0), "send period 0 ms is outside 1..100 ms"),
        (lambda: FriSettings(peer=PEER, send_period_ms=101), "send period 101 ms is outside 1..100 ms"),
        (lambda: FriSettings(peer=PEER, receive_multiplier=0), "receive multiplier 0 is less than 1"),
        (
            lambda: FriSettings(peer=PEER, send_period_ms=20, receive_multiplier=6),
            "send period 20 ms x receive multiplier 6 = 120 ms is more than 100 ms",
        ),
        (
            lambda: FriSettings(peer=PEER, send_period_ms=20, watchdog_ms=19),
            "FRI watchdog 19 ms is outside 20..1000 ms",
        ),
        (lambda: controller(3), "control cycle 3 ms is none of 1, 2, 4, 5 ms"),
        (
            lambda: controller(2, FriSettings(peer=PEER, send_period_ms=5)),
            "send period 5 ms is no multiple of the control cycle of 2 ms",
        ),
    ],
)
def test_what_cannot_work_is_refused_in_words(make: object, sentence: str) -> None:
    assert callable(make)
    with pytest.raises(ConfigurationError, match=f"^{sentence}"):
        make()


def test_watchdog_is_fifty_milliseconds_or_three_budgets() -> None:
    assert FriSettings(peer=PEER).watchdog_ns == 50_000_000
    assert FriSettings(peer=PEER, send_period_ms=10, receive_multiplier=4).watchdog_ns == 120_000_000
    assert FriSettings(peer=PEER, watchdog_ms=7).watchdog_ns == 7_000_000
