"""``hil doctor udp``: round trip, jitter and loss between this host and a running controller's servo link."""

from collections.abc import Callable

from hil.clock import MonotonicClock, unix_time_ns
from hil.values.finding import Diagnosis
from hil.values.link import Address
from hil.values.servo import ServoClientCodec
from tools.doctor.udp.figures import figures
from tools.doctor.udp.measure import watch
from tools.doctor.udp.opening import ANSWER_WITHIN_S, join
from tools.doctor.udp.stamped import StampedSocket
from tools.doctor.udp.verdict import judge
from transport.udp import is_local


def diagnose_udp(
    controller: Address,
    codec: ServoClientCodec,
    *,
    seconds: float,
    period_ms: int | None = None,
    has_key: bool = False,
    answer_within_s: float = ANSWER_WITHIN_S,
    progress: Callable[[float], None] = lambda _: None,
) -> Diagnosis:
    """Watch ``controller`` for ``seconds`` as an observer, who changes nothing; ``progress`` gets the seconds.

    Raises :class:`EndpointError` where it cannot be watched: nobody there, no answer, no seat, another version.
    """
    clock = MonotonicClock()
    with StampedSocket(controller, clock) as sock:
        joined = join(sock, codec, period_ms=period_ms, has_key=has_key, within_s=answer_within_s)
        unix_minus_clock_ns = unix_time_ns() - clock.now_ns()
        tally = watch(sock, codec, joined, seconds=seconds, clock=clock, progress=progress)
    return judge(
        figures(tally, joined.welcome, period_ms=joined.period_ms, unix_minus_clock_ns=unix_minus_clock_ns),
        controller=controller,
        same_machine=is_local(controller.host),
    )
