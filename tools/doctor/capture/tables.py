"""The evidence below the verdict, as tables."""

from collections.abc import Iterable, Mapping, Sequence

from hil.core.diagnosis.answer_path import SlowAnswer
from hil.core.statistics import Histogram
from hil.values.finding import EvidenceTable
from hil.values.outcomes import Outcome

_OWN_PARTS = {
    "send_lateness": "our send: due to departed",
    "peer_and_wire": "peer and wire: departed to the kernel's stamp",
    "wait": "wait for the next cycle, by design",
    "use_lateness": "our use: that cycle's lateness",
}
_SEEN_PARTS = {
    "send_lateness": "send: behind the grid of its messages",
    "peer_and_wire": "peer and wire: message to answer, at the capture's place",
}
_PEERS = (Outcome.DUPLICATE, Outcome.REORDERED, Outcome.REPLAYED, Outcome.UNSENT_SEQUENCE)
"""What becomes of answers by peer or wire alone, whatever the controller does."""
_ROWS = 12


def split_table(title: str, parts: Mapping[str, Histogram], *, own: bool) -> EvidenceTable:
    """Return the distribution of each part of the answers' time, [ms]; those of others than ``own`` have two."""
    told = _OWN_PARTS if own else _SEEN_PARTS
    rows = [
        (told[name], str(part.count), *(_ms(value) for value in part.summary_us().values()))
        for name, part in parts.items()
        if name in told
    ]
    return EvidenceTable(title, ("part [ms]", "count", "p50", "p99", "p99.9", "max"), tuple(rows))


def slowest_table(title: str, answers: Sequence[SlowAnswer], limit: int, *, own: bool) -> EvidenceTable:
    """Return the slowest answers with their split, in milliseconds; what follows the stamp only where it is known."""
    columns = ("message", "at", "our send", "peer and wire") if own else ("message", "at", "send", "peer and wire")
    rows: list[tuple[str, ...]] = []
    for one in answers[:limit]:
        row = (str(one.counter), f"{one.received_ns / 1e9:.3f} s", _ns(one.send_lateness_ns), _ns(one.age_ns))
        rows.append((*row, _ns(one.wait_ns), _ns(one.use_lateness_ns), str(one.cycle)) if own else row)
    return EvidenceTable(title, (*columns, "wait", "our use", "cycle") if own else columns, tuple(rows))


def fault_table(title: str, counts: Mapping[str, Mapping[str, int]], outcomes: Mapping[Outcome, int]) -> EvidenceTable:
    """Return late and missing answers by whose fault, and what else became of answers, which is peer's or wire's."""
    rows = [(what, str(of["controller"]), str(of["peer_or_wire"]), str(of["both"])) for what, of in counts.items()]
    rows += [(one.value.replace("_", " "), "0", str(outcomes[one]), "0") for one in _PEERS if outcomes[one]]
    return EvidenceTable(title, ("answers", "the controller's", "peer's or wire's", "both"), tuple(rows))


def state_table(title: str, changes: Iterable[tuple[str, ...]], columns: tuple[str, ...]) -> EvidenceTable:
    """Return the session states over time; where there are many, the last ones."""
    rows = tuple(changes)
    more = f" (the last {_ROWS} of {len(rows)})" if len(rows) > _ROWS else ""
    return EvidenceTable(f"{title}{more}", columns, rows[-_ROWS:])


def _ms(value_us: float | None) -> str:
    return "-" if value_us is None else f"{value_us / 1e3:.3f}"


def _ns(value_ns: int) -> str:
    return f"{value_ns / 1e6:.3f}"
