"""Whether the machine can hold the cycle, why not, and what helps, in order of effect."""

from typing import Final, NamedTuple

from hil.core.settings import NS_PER_MS
from hil.runtime.realtime import FIFO_PRIORITY
from hil.values.finding import Diagnosis, EvidenceTable, Figure, Finding, Severity, Whose
from tools.bench.bounds import LATENESS_P99_US, MISSED_SHARE, at_most
from tools.doctor.host.condition import BUSY_SHARE, BusyProcess, Condition
from tools.doctor.host.lateness import Lateness
from transport.udp import RECEIVE_BUFFER_BYTES

UNKNOWN: Final = "not known here"
CAUSE_SHARE: Final = 0.005
"""Of the measurement: what is below is no cause."""
_SLOW_GOVERNORS: Final = frozenset({"powersave", "ondemand", "conservative", "schedutil"})
"""Those that let a CPU sleep or slow down between two cycles."""


class _Cause(NamedTuple):
    """What keeps the timer waiting: how much of the measurement it took, in words, and what helps."""

    share: float
    sentence: str
    remedy: str


def judge(lateness: Lateness, condition: Condition) -> Diagnosis:
    """Return the verdict on a measurement, the causes it shows, and the readings."""
    findings = [_verdict(lateness, condition)]
    if condition.receive_errors:
        findings.append(_dropped_datagrams(condition.receive_errors))
    if (most := condition.receive_buffer_max_bytes) is not None and most < RECEIVE_BUFFER_BYTES:
        findings.append(_small_buffers(most))
    return Diagnosis(tuple(findings), (_lateness_table(lateness), _readings_table(condition)))


def _verdict(lateness: Lateness, condition: Condition) -> Finding:
    cycle_ms = lateness.cycle_ns / NS_PER_MS
    rate = "1 kHz" if cycle_ms == 1 else f"{1000 / cycle_ms:g} Hz"
    late_us = lateness.late.summary_us()
    p99_us, worst_us = late_us["p99"] or 0.0, late_us["max"] or 0.0
    bounds = (
        # The design's bound is for cycles of 1 ms: a fifth of it.
        at_most("lateness p99", p99_us, LATENESS_P99_US * cycle_ms, "us"),
        at_most("missed cycles", 100 * lateness.missed_share, 100 * MISSED_SHARE, "%"),
    )
    figures: dict[str, Figure] = {
        "cycle_ms": cycle_ms,
        "cycles": lateness.cycles,
        "missed": lateness.missed,
        "stalls": lateness.stalls,
        **{f"lateness_{name}_us": value for name, value in late_us.items()},
    }
    measured = (
        f"lateness p99 {p99_us:.0f} us (bound {LATENESS_P99_US * cycle_ms:.0f}), longest {_time(worst_us)}, "
        f"{lateness.missed} of {lateness.cycles} cycles missed"
    )
    alone = "the timer alone was measured: the work of a controller comes on top, see: hil bench cycle"
    causes = _measured_causes(condition)
    remedies = tuple(cause.remedy for cause in causes) + _standing_remedies(condition)
    if all(bound.kept for bound in bounds):
        return Finding(
            "host-timing",
            Severity.GOOD,
            Whose.NOBODY,
            f"this host can hold {rate}: {measured}",
            (alone, *(cause.sentence for cause in causes)),
            remedies if lateness.missed or causes else (),
            figures,
        )
    missed = f"{100 * lateness.missed_share:.2g} % of the cycles missed; " if not bounds[1].kept else ""
    why = causes[0].sentence if causes else _no_cause(condition)
    return Finding(
        "host-timing",
        Severity.FAULT,
        Whose.HOST,
        f"this host cannot hold {rate}: {missed}{measured}; {why}",
        (alone, *(cause.sentence for cause in causes[1:])),
        remedies,
        figures,
    )


def _measured_causes(condition: Condition) -> list[_Cause]:
    """Return what took time from this process while it was measured, the greatest first."""
    causes = []
    if (throttled := condition.throttled_share or 0.0) >= CAUSE_SHARE:
        allowed = "" if condition.quota_cpus is None else f" of {condition.quota_cpus:g} CPUs"
        causes.append(
            _Cause(
                throttled,
                f"its control group was held back {_percent(throttled)} of the time by its quota{allowed}",
                "give the container more CPU, or no quota (docker run --cpus, cpu.max)",
            )
        )
    if (stolen := condition.stolen_share or 0.0) >= CAUSE_SHARE:
        causes.append(
            _Cause(
                stolen,
                f"the hypervisor took {_percent(stolen)} of the CPUs' time for others (steal)",
                "no setting in a virtual machine brings back what its host takes: pin its CPUs there, or use a machine "
                "of its own",
            )
        )
    waited = condition.waited_share or 0.0
    if waited >= CAUSE_SHARE:
        others = _processes(condition.busiest or ())
        causes.append(
            _Cause(
                waited,
                f"its process was ready to run and had no CPU {_percent(waited)} of the time"
                + (f"; others took it: {others} of one CPU" if others else ""),
                f"stop what competes, or keep it off a CPU (taskset, isolcpus): {others or 'see top'}",
            )
        )
    if condition.swapped_pages:
        causes.append(
            _Cause(
                0.0,
                f"{condition.swapped_pages} pages were swapped meanwhile",
                "more memory, or no swap (swapoff); hil run --realtime locks its own memory",
            )
        )
    return sorted(causes, key=lambda cause: -cause.share)


def _standing_remedies(condition: Condition) -> tuple[str, ...]:
    """Return what would help this machine without having been measured as a cause, the most effective first."""
    remedies = []
    if condition.scheduling is not None and not condition.scheduling.startswith(("SCHED_FIFO", "SCHED_RR")):
        if condition.may_be_realtime:
            remedies.append("hil run --realtime: SCHED_FIFO is allowed here, and goes before ordinary processes")
        elif condition.may_be_realtime is not None:
            remedies.append(
                f"hil run --realtime, once it is allowed: a line '@realtime - rtprio {FIFO_PRIORITY}' in "
                "/etc/security/limits.conf and a new login (ulimit -r shows it), or setcap cap_sys_nice+ep on the "
                "interpreter"
            )
    if condition.governor is not None and _SLOW_GOVERNORS & set(condition.governor.split(", ")):
        remedies.append(f"cpupower frequency-set -g performance: the governor is {condition.governor}")
    if condition.preemption is not None and condition.preemption != "PREEMPT_RT":
        remedies.append(f"a kernel with PREEMPT_RT bounds the rare long waits; this one has {condition.preemption}")
    return tuple(remedies)


def _no_cause(condition: Condition) -> str:
    if condition.governor is not None and _SLOW_GOVERNORS & set(condition.governor.split(", ")):
        return f"the governor {condition.governor} lets the CPUs sleep or slow down between two cycles"
    if condition.waited_share is None:
        return "why is not known here"
    guest = ", or the hypervisor" if condition.virtual else ""
    return f"no other process had its CPU, so it is the kernel, its drivers or the power saving of the CPUs{guest}"


def _dropped_datagrams(count: int) -> Finding:
    return Finding(
        "receive-buffer",
        Severity.WARNING,
        Whose.HOST,
        f"this host dropped {count} UDP datagrams meanwhile because the buffer of their socket was full: a program on "
        "it reads too late",
        ("RcvbufErrors in /proc/net/snmp, of all programs together",),
        ("find the socket: ss -uamp shows drops as d<number>",),
        {"receive_buffer_errors": count},
    )


def _small_buffers(most_bytes: int) -> Finding:
    return Finding(
        "receive-buffer-limit",
        Severity.NOTE,
        Whose.HOST,
        f"receive buffers end at {most_bytes // 1024} KiB here, hil asks for {RECEIVE_BUFFER_BYTES // 1024} KiB: a "
        "stall loses datagrams sooner",
        (),
        (f"sysctl -w net.core.rmem_max={RECEIVE_BUFFER_BYTES}",),
        {"receive_buffer_max_bytes": most_bytes},
    )


def _lateness_table(lateness: Lateness) -> EvidenceTable:
    late = lateness.late.summary_us()
    title = f"lateness of the timer, {lateness.cycles} cycles of {lateness.cycle_ns / NS_PER_MS:g} ms"
    row = (*("-" if value is None else f"{value:.0f}" for value in late.values()), str(lateness.missed))
    return EvidenceTable(title, ("p50 us", "p99 us", "p99.9 us", "max us", "missed"), (row,))


def _readings_table(condition: Condition) -> EvidenceTable:
    rows = {
        "system": condition.system,
        "kernel preemption": condition.preemption,
        "virtual machine": None if condition.virtual is None else "yes" if condition.virtual else "no",
        "CPUs": str(condition.cpus)
        if condition.cpus_allowed is None
        else f"{condition.cpus}, this process may use {condition.cpus_allowed}",
        "scheduling": condition.scheduling,
        "real-time priority allowed": _realtime_text(condition),
        "memory that may be locked": _limit(condition.locked_memory_limit_bytes, 1024, "KiB"),
        "frequency governor": condition.governor,
        "timer slack": None if condition.timer_slack_ns is None else f"{condition.timer_slack_ns / 1000:g} us",
        "CPU time used, all CPUs": _share(condition.busy_share),
        "taken by the hypervisor": _share(condition.stolen_share),
        "this process waited for a CPU": _share(condition.waited_share),
        "somebody waited for a CPU": _share(condition.pressure_share),
        "this process was preempted": None if condition.preempted is None else f"{condition.preempted} times",
        "quota of the control group": _quota_text(condition),
        "load, one minute": None if condition.one_minute_load is None else f"{condition.one_minute_load:.2f}",
        "busiest others on its CPUs": None
        if condition.busiest is None
        else _processes(condition.busiest) or f"none above {_percent(BUSY_SHARE)} of one CPU",
        "pages swapped": None if condition.swapped_pages is None else str(condition.swapped_pages),
        "receive buffer, most / default": None
        if condition.receive_buffer_max_bytes is None or condition.receive_buffer_default_bytes is None
        else f"{condition.receive_buffer_max_bytes // 1024} / {condition.receive_buffer_default_bytes // 1024} KiB",
        "UDP datagrams dropped, buffer full": None
        if condition.receive_errors is None
        else str(condition.receive_errors),
    }
    return EvidenceTable(
        "this host, while it was measured",
        ("what", "reading"),
        tuple((what, UNKNOWN if reading is None else reading) for what, reading in rows.items()),
    )


def _processes(processes: tuple[BusyProcess, ...]) -> str:
    return ", ".join(f"{one.name} ({one.pid}) {100 * one.share:.0f} %" for one in processes)


def _realtime_text(condition: Condition) -> str | None:
    if condition.may_be_realtime is None:
        return None
    limit = _limit(condition.realtime_priority_limit, 1, "")
    capability = ", but the process has CAP_SYS_NICE" if condition.may_change_priority else ""
    return f"{limit}{capability}" if limit is not None else capability.removeprefix(", but ")


def _quota_text(condition: Condition) -> str | None:
    if condition.throttled_share is None:
        return None
    allowed = "none" if condition.quota_cpus is None else f"{condition.quota_cpus:g} CPUs"
    return f"{allowed}, held back {_percent(condition.throttled_share)} of the time"


def _limit(value: int | None, unit: int, name: str) -> str | None:
    if value is None:
        return None
    return "no limit" if value < 0 else f"up to {value // unit} {name}".rstrip()


def _share(share: float | None) -> str | None:
    return None if share is None else _percent(share)


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"


def _time(value_us: float) -> str:
    return f"{value_us / 1000:.1f} ms" if value_us >= 1000 else f"{value_us:.0f} us"
