"""A run as a picture: what was commanded and measured, what the session did, how late the client answered.

``python -m tools.plot_run CAPTURE.pcapng STATUS.json PICTURE.png``
"""

import json
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hil.values.errors import ConfigurationError, MalformedDatagram
from hil.values.fri import Release, SessionState
from hil.values.fri_messages import CommandMessage, MonitoringMessage
from hil.values.link import Address
from transport.capture.reading import read_capture
from transport.fri import FriCodec
from transport.udp import parse_address

_MILLIRADIANS = 1e3
_STATE_COLOURS = {
    SessionState.IDLE: "#ffffff",
    SessionState.MONITORING_WAIT: "#f4d9d0",
    SessionState.MONITORING_READY: "#f7ecc6",
    SessionState.COMMANDING_WAIT: "#d3e4f3",
    SessionState.COMMANDING_ACTIVE: "#d5ecd4",
}


@dataclass
class Series:
    """What a capture holds of one robot; times in s since its first datagram, angles in rad, latency in ms."""

    monitored_s: list[float] = field(default_factory=list)
    measured: list[tuple[float, ...]] = field(default_factory=list)
    states: list[SessionState] = field(default_factory=list)
    commanded_s: list[float] = field(default_factory=list)
    commanded: list[tuple[float, ...]] = field(default_factory=list)
    answered_s: list[float] = field(default_factory=list)
    latency_ms: list[float] = field(default_factory=list)


def read_series(capture: Path, *, codec: FriCodec, controller: Address) -> Series:
    """Return the series of the robot that was served from ``controller``; raise CaptureError."""
    series = Series()
    sent_at_ns: dict[int, int] = {}
    begin_ns: int | None = None
    for datagram in read_capture(capture):
        begin_ns = datagram.at_unix_ns if begin_ns is None else begin_ns
        at_s = (datagram.at_unix_ns - begin_ns) / 1e9
        try:
            if datagram.source == controller:
                message = codec.decode_monitoring(datagram.payload)
                sent_at_ns[message.sequence_counter] = datagram.at_unix_ns
                _add_monitoring(series, message, at_s)
            elif datagram.destination == controller:
                answer = codec.decode_command(datagram.payload)
                _add_answer(series, answer, at_s, datagram.at_unix_ns, sent_at_ns)
        except MalformedDatagram:
            continue
    return series


def plot_run(capture: Path, status: dict[str, Any], picture: Path) -> None:
    """Draw the first robot with an FRI link of a run into ``picture`` (PNG)."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    name, robot = _first_fri_robot(status)
    codec = FriCodec(Release(robot["fri"]["release"]))
    series = read_series(capture, codec=codec, controller=parse_address(robot["fri"]["bound"], default_port=0))
    if not series.measured:
        raise ConfigurationError(f"{capture} holds no FRI packet of {name}")
    axis = _most_moved(series)
    figure, (motion, error, latency) = plt.subplots(
        3, 1, figsize=(10, 7.5), sharex=True, layout="constrained", height_ratios=(3, 1.4, 1.4)
    )
    figure.suptitle(
        f"{robot['model']}, {robot['backend']} arm, FRI {robot['fri']['release']} at "
        f"{robot['fri']['send_period_ms']} ms: {robot['rate_hz']:.2f} Hz, {robot['missed_cycles']} cycles missed"
    )
    start = series.measured[0][axis]
    for panel in (motion, error, latency):
        _shade_states(panel, series)
        panel.grid(alpha=0.3)
        panel.margins(x=0.005)
    commanded = [(position[axis] - start) * _MILLIRADIANS for position in series.commanded]
    measured = [(position[axis] - start) * _MILLIRADIANS for position in series.measured]
    motion.plot(
        series.commanded_s, commanded, label=f"A{axis + 1} commanded by the client", linewidth=2.2, color="#7aa6d1"
    )
    motion.plot(series.monitored_s, measured, label=f"A{axis + 1} measured", linewidth=1.0, color="#12304f")
    motion.set_ylabel("from the start, mrad")
    _legend(motion, series)
    lag_s, lag = _tracking(series, axis)
    error.plot(lag_s, lag, linewidth=0.7, color="#8a3324")
    error.set_ylabel("commanded - measured,\nmrad")
    latency.plot(series.answered_s, series.latency_ms, ".", markersize=1.2, color="#444444")
    budget_ms = robot["fri"]["send_period_ms"] * robot["fri"]["receive_multiplier"]
    latency.axhline(budget_ms, color="#c0392b", linewidth=0.8)
    latency.set_ylabel("answer latency, ms\n(line: budget)")
    latency.set_ylim(0, 1.25 * budget_ms)
    latency.set_xlabel("time, s")
    figure.savefig(picture, dpi=110)
    plt.close(figure)


def _first_fri_robot(status: dict[str, Any]) -> tuple[str, dict[str, Any]]:
    for name, robot in status["robots"].items():
        if robot["fri"] is not None:
            return name, robot
    raise ConfigurationError("no robot of this run has an FRI link, so there is nothing to plot")


def _add_monitoring(series: Series, message: MonitoringMessage, at_s: float) -> None:
    if message.monitor is None or message.monitor.measured_position is None or message.connection is None:
        return
    series.monitored_s.append(at_s)
    series.measured.append(message.monitor.measured_position)
    series.states.append(SessionState(message.connection.session_state))


def _add_answer(
    series: Series, answer: CommandMessage, at_s: float, at_unix_ns: int, sent_at_ns: dict[int, int]
) -> None:
    sent_ns = sent_at_ns.get(answer.reflected_sequence_counter)
    if sent_ns is not None:
        series.answered_s.append(at_s)
        series.latency_ms.append((at_unix_ns - sent_ns) / 1e6)
    active = bool(series.states) and series.states[-1] is SessionState.COMMANDING_ACTIVE
    if active and answer.command is not None and answer.command.position is not None:
        series.commanded_s.append(at_s)
        series.commanded.append(answer.command.position)


def _most_moved(series: Series) -> int:
    spans = [max(path) - min(path) for path in zip(*series.measured, strict=True)]
    return spans.index(max(spans))


def _tracking(series: Series, axis: int) -> tuple[list[float], list[float]]:
    import numpy as np

    if not series.commanded:
        return [], []
    measured = np.interp(series.commanded_s, series.monitored_s, [position[axis] for position in series.measured])
    lag = (np.array([position[axis] for position in series.commanded]) - measured) * _MILLIRADIANS
    return series.commanded_s, lag.tolist()


def _spans(series: Series) -> list[tuple[float, float, SessionState]]:
    spans: list[tuple[float, float, SessionState]] = []
    for at_s, state in zip(series.monitored_s, series.states, strict=True):
        if spans and spans[-1][2] is state:
            spans[-1] = (spans[-1][0], at_s, state)
        else:
            spans.append((spans[-1][1] if spans else at_s, at_s, state))
    return spans


def _shade_states(panel: Any, series: Series) -> None:
    for begin, end, state in _spans(series):
        panel.axvspan(begin, end, color=_STATE_COLOURS[state], linewidth=0)


def _legend(panel: Any, series: Series) -> None:
    from matplotlib.patches import Patch

    handles, _ = panel.get_legend_handles_labels()
    seen = dict.fromkeys(state for _, _, state in _spans(series) if state is not SessionState.IDLE)
    handles += [Patch(color=_STATE_COLOURS[state], label=state.name) for state in seen]
    panel.figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize="small", frameon=False)


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    plot_run(Path(sys.argv[1]), json.loads(Path(sys.argv[2]).read_text(encoding="utf-8")), Path(sys.argv[3]))
