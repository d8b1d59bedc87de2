"""The machine looked at twice, before and after a measurement, and what lies between. What it does not say is None."""

import os
import platform
import sys
from collections.abc import Mapping
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

from hil.clock import elapsed_ns
from tools.doctor.host import readings
from tools.doctor.host.readings import CpuTimes, ProcessTime, Quota

MOST_PROCESSES: Final = 4096
"""So many are looked at; who has more has another trouble."""
BUSIEST: Final = 3
BUSY_SHARE: Final = 0.05
"""Of one CPU; processes below are not worth a line."""


class Look(NamedTuple):
    """What grows, as it is at one moment."""

    at_ns: int
    cpu: CpuTimes | None
    waited_ns: int | None
    preempted: int | None
    pressure_us: int | None
    quota: Quota | None
    receive_errors: int | None
    swapped_pages: int | None
    processes: Mapping[int, ProcessTime]


class BusyProcess(NamedTuple):
    """Another process, and how much of one CPU it used."""

    pid: int
    name: str
    share: float


@dataclass(frozen=True, slots=True)
class Condition:
    """The machine over a measurement. Shares are 0 to 1; None: not known here."""

    system: str
    cpus: int
    cpus_allowed: int | None
    scheduling: str | None
    realtime_priority_limit: int | None
    """RLIMIT_RTPRIO; -1: none."""
    may_change_priority: bool | None
    locked_memory_limit_bytes: int | None
    """RLIMIT_MEMLOCK; -1: none."""
    governor: str | None
    virtual: bool | None
    preemption: str | None
    timer_slack_ns: int | None
    receive_buffer_max_bytes: int | None
    receive_buffer_default_bytes: int | None
    one_minute_load: float | None
    stolen_share: float | None = None
    """Of the time of all CPUs: what the hypervisor gave to others while they were wanted here."""
    busy_share: float | None = None
    """Of the time of all CPUs, ours included."""
    waited_share: float | None = None
    """Of the measurement: the time this process was ready to run and had no CPU."""
    preempted: int | None = None
    pressure_share: float | None = None
    quota_cpus: float | None = None
    throttled_share: float | None = None
    receive_errors: int | None = None
    swapped_pages: int | None = None
    busiest: tuple[BusyProcess, ...] | None = None
    """Other processes on the CPUs this one may use."""

    @property
    def may_be_realtime(self) -> bool | None:
        """Whether SCHED_FIFO would be granted; None: not known here."""
        if self.may_change_priority is None and self.realtime_priority_limit is None:
            return None
        return bool(self.may_change_priority) or (self.realtime_priority_limit or 0) != 0


def look() -> Look:
    """Return what the machine's counters are now."""
    return Look(
        at_ns=elapsed_ns(),
        cpu=readings.cpu_times(_read("/proc/stat")),
        waited_ns=readings.waited_ns(_read("/proc/thread-self/schedstat")),
        preempted=_preempted(),
        pressure_us=readings.pressure_us(_read("/proc/pressure/cpu")),
        quota=_quota(),
        receive_errors=readings.udp_receive_buffer_errors(_read("/proc/net/snmp")),
        swapped_pages=readings.swapped_pages(_read("/proc/vmstat")),
        processes=_processes(),
    )


def over(before: Look, after: Look) -> Condition:
    """Return what the machine is, and what happened to it between two looks."""
    took_ns = max(1, after.at_ns - before.at_ns)
    stolen_share = busy_share = None
    if before.cpu is not None and after.cpu is not None and (total := after.cpu.total - before.cpu.total) > 0:
        stolen_share = (after.cpu.stolen - before.cpu.stolen) / total
        busy_share = 1.0 - (after.cpu.idle - before.cpu.idle) / total
    waited_ns = _grown(before.waited_ns, after.waited_ns)
    pressure_us = _grown(before.pressure_us, after.pressure_us)
    throttled_us = None
    if before.quota is not None and after.quota is not None:
        throttled_us = after.quota.throttled_us - before.quota.throttled_us
    realtime_limit, locked_limit = _limits()
    allowed = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else None
    return Condition(
        system=f"{platform.system()} {platform.release()}",
        cpus=os.cpu_count() or 1,
        cpus_allowed=None if allowed is None else len(allowed),
        scheduling=_scheduling(),
        realtime_priority_limit=realtime_limit,
        may_change_priority=readings.may_change_priority(_read("/proc/self/status")),
        locked_memory_limit_bytes=locked_limit,
        governor=readings.governors(
            _read(path) for path in Path("/sys/devices/system/cpu").glob("cpu[0-9]*/cpufreq/scaling_governor")
        ),
        virtual=readings.is_virtual(_read("/proc/cpuinfo")),
        preemption=readings.preemption(platform.version(), _read("/sys/kernel/realtime") or None),
        timer_slack_ns=_number("/proc/self/timerslack_ns"),
        receive_buffer_max_bytes=_number("/proc/sys/net/core/rmem_max"),
        receive_buffer_default_bytes=_number("/proc/sys/net/core/rmem_default"),
        one_minute_load=readings.one_minute_load(_read("/proc/loadavg")),
        stolen_share=stolen_share,
        busy_share=busy_share,
        waited_share=None if waited_ns is None else waited_ns / took_ns,
        preempted=_grown(before.preempted, after.preempted),
        pressure_share=None if pressure_us is None else 1000 * pressure_us / took_ns,
        quota_cpus=None if after.quota is None else after.quota.cpus,
        throttled_share=None if throttled_us is None else 1000 * throttled_us / took_ns,
        receive_errors=_grown(before.receive_errors, after.receive_errors),
        swapped_pages=_grown(before.swapped_pages, after.swapped_pages),
        busiest=busiest(
            before.processes, after.processes, allowed=allowed, took_ns=took_ns, ticks_per_s=_ticks_per_s()
        ),
    )


def busiest(
    before: Mapping[int, ProcessTime],
    after: Mapping[int, ProcessTime],
    *,
    allowed: AbstractSet[int] | None,
    took_ns: int,
    ticks_per_s: int,
) -> tuple[BusyProcess, ...] | None:
    """Return the processes that used most between two looks, of those on the CPUs ``allowed`` (None: all).

    What began and ended in between is not seen. None where no process is.
    """
    if not after:
        return None
    found = []
    for pid, now in after.items():
        if allowed is not None and now.cpu not in allowed:
            continue
        earlier = before.get(pid)
        ticks = now.ticks - (earlier.ticks if earlier is not None and earlier.began == now.began else 0)
        share = ticks / ticks_per_s / (took_ns * 1e-9)
        if share >= BUSY_SHARE:
            found.append(BusyProcess(pid, now.name, share))
    return tuple(sorted(found, key=lambda process: -process.share)[:BUSIEST])


def _processes() -> dict[int, ProcessTime]:
    found: dict[int, ProcessTime] = {}
    try:
        pids = [int(entry) for entry in os.listdir("/proc") if entry.isdecimal()]  # noqa: PTH208  # names alone
    except OSError:
        return found
    for pid in pids[:MOST_PROCESSES]:
        if pid != os.getpid() and (time := readings.process_time(_read(f"/proc/{pid}/stat"))) is not None:
            found[pid] = time
    return found


def _quota() -> Quota | None:
    for path in readings.group_paths(_read("/proc/self/cgroup")):
        found = readings.quota(
            _read(f"{path}/cpu.max") or None,
            _read(f"{path}/cpu.cfs_quota_us") or None,
            _read(f"{path}/cpu.cfs_period_us") or None,
            _read(f"{path}/cpu.stat"),
        )
        if found is not None:
            return found
    return None


def _scheduling() -> str | None:
    if not hasattr(os, "sched_getscheduler"):
        return None
    number = os.sched_getscheduler(0)
    names = ("SCHED_OTHER", "SCHED_FIFO", "SCHED_RR", "SCHED_BATCH", "SCHED_IDLE")
    name = next((name for name in names if getattr(os, name, None) == number), f"class {number}")
    if name in {"SCHED_FIFO", "SCHED_RR"}:
        return f"{name} priority {os.sched_getparam(0).sched_priority}"
    return f"{name}, nice {os.getpriority(os.PRIO_PROCESS, 0)}"


def _limits() -> tuple[int | None, int | None]:
    if sys.platform != "linux":
        return None, None
    import resource

    return resource.getrlimit(resource.RLIMIT_RTPRIO)[0], resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]


def _preempted() -> int | None:
    if sys.platform == "win32":
        return None
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_nivcsw


def _ticks_per_s() -> int:
    return os.sysconf("SC_CLK_TCK") if hasattr(os, "sysconf") else 100


def _grown(before: int | None, after: int | None) -> int | None:
    return None if before is None or after is None else after - before


def _number(path: str) -> int | None:
    text = _read(path).strip()
    return int(text) if text.isdecimal() else None


def _read(path: str | Path) -> str:
    """Return the text of a file of the kernel's; empty where there is none, or none for us."""
    try:
        return Path(path).read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
