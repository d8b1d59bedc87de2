"""What the kernel says of itself, read from its texts: pure functions, None where a text does not say it.

The texts are those of ``/proc`` and ``/sys`` (proc(5), Documentation/scheduler/sched-stats.rst, cgroup-v2.rst).
"""

from collections import Counter
from collections.abc import Iterable
from typing import Final, NamedTuple

CAP_SYS_NICE: Final = 23
_BUSY_FIELDS: Final = 8
"""user, nice, system, idle, iowait, irq, softirq, steal; what follows is counted in user already."""


class CpuTimes(NamedTuple):
    """Time of all CPUs together since the machine began, in clock ticks."""

    total: int
    idle: int
    stolen: int


class ProcessTime(NamedTuple):
    """CPU time a process has used, in clock ticks, and the CPU it was on last.

    ``began`` tells it from a later one with its number.
    """

    name: str
    ticks: int
    began: int
    cpu: int


class Quota(NamedTuple):
    """What a control group may use, in CPUs; None: all there are. And how long it was held back, in us."""

    cpus: float | None
    throttled_us: int


def cpu_times(stat: str) -> CpuTimes | None:
    """Read ``/proc/stat``."""
    for line in stat.splitlines():
        name, _, rest = line.partition(" ")
        numbers = rest.split()
        if name == "cpu" and len(numbers) >= _BUSY_FIELDS:
            times = [int(number) for number in numbers[:_BUSY_FIELDS]]
            return CpuTimes(sum(times), times[3] + times[4], times[7])
    return None


def process_time(stat: str) -> ProcessTime | None:
    """Read ``/proc/PID/stat``; the name may hold blanks and brackets."""
    head, bracket, tail = stat.rpartition(")")
    fields = tail.split()
    if not bracket or len(fields) < 37:
        return None
    ticks = int(fields[11]) + int(fields[12])
    return ProcessTime(head.partition("(")[2], ticks, began=int(fields[19]), cpu=int(fields[36]))


def waited_ns(schedstat: str) -> int | None:
    """Read ``/proc/PID/schedstat``: how long it was ready to run and had no CPU."""
    fields = schedstat.split()
    return int(fields[1]) if len(fields) >= 3 else None


def pressure_us(pressure: str) -> int | None:
    """Read ``/proc/pressure/cpu``: how long somebody was ready to run and had no CPU."""
    for line in pressure.splitlines():
        if line.startswith("some "):
            return int(line.rpartition("total=")[2])
    return None


def udp_receive_buffer_errors(snmp: str) -> int | None:
    """Read ``/proc/net/snmp``: datagrams dropped because a socket's buffer was full."""
    rows = [line.split() for line in snmp.splitlines() if line.startswith("Udp: ")]
    if len(rows) != 2 or "RcvbufErrors" not in rows[0]:
        return None
    return int(rows[1][rows[0].index("RcvbufErrors")])


def swapped_pages(vmstat: str) -> int | None:
    """Read ``/proc/vmstat``: pages swapped in and out."""
    counts = dict(line.split()[:2] for line in vmstat.splitlines() if line.startswith("pswp"))
    return sum(map(int, counts.values())) if counts else None


def one_minute_load(loadavg: str) -> float | None:
    """Read ``/proc/loadavg``."""
    fields = loadavg.split()
    return float(fields[0]) if fields else None


def is_virtual(cpuinfo: str) -> bool | None:
    """Read ``/proc/cpuinfo``: whether a hypervisor runs this machine; None where processors do not say."""
    flags = next((line for line in cpuinfo.splitlines() if line.startswith("flags")), None)
    return None if flags is None else "hypervisor" in flags.split()


def may_change_priority(status: str) -> bool | None:
    """Read ``/proc/self/status``: whether the process has CAP_SYS_NICE."""
    for line in status.splitlines():
        if line.startswith("CapEff:"):
            return bool(int(line.split()[1], 16) >> CAP_SYS_NICE & 1)
    return None


def preemption(version: str, realtime: str | None) -> str | None:
    """Read ``uname -v`` and ``/sys/kernel/realtime``: how far the kernel lets itself be interrupted."""
    if realtime is not None and realtime.strip() == "1":
        return "PREEMPT_RT"
    return next((word for word in version.split() if word.startswith("PREEMPT")), None)


def governors(texts: Iterable[str]) -> str | None:
    """Read each CPU's ``cpufreq/scaling_governor``; None where there are none, as in most virtual machines."""
    counts = Counter(text.strip() for text in texts)
    return ", ".join(sorted(counts)) or None


def group_paths(cgroup: str) -> tuple[str, ...]:
    """Read ``/proc/self/cgroup``: where the files of this process's CPU controller may be, the nearest first."""
    found: list[str] = []
    for line in cgroup.splitlines():
        _, controllers, path = (*line.split(":", 2), "", "")[:3]
        if not controllers:
            found += [f"/sys/fs/cgroup{path.rstrip('/')}", "/sys/fs/cgroup"]
        elif "cpu" in controllers.split(","):
            found += [f"/sys/fs/cgroup/{controllers}{path.rstrip('/')}", f"/sys/fs/cgroup/{controllers}"]
    return tuple(dict.fromkeys(found))


def quota(cpu_max: str | None, cfs_quota: str | None, cfs_period: str | None, cpu_stat: str) -> Quota | None:
    """Read a group's ``cpu.max`` (version 2) or ``cpu.cfs_*_us`` (version 1), and its ``cpu.stat``."""
    counts = dict(line.split()[:2] for line in cpu_stat.splitlines() if len(line.split()) >= 2)
    throttled_us = int(counts.get("throttled_usec", 0)) + int(counts.get("throttled_time", 0)) // 1000
    if cpu_max is not None and len(cpu_max.split()) == 2:
        allowed, period = cpu_max.split()
    elif cfs_quota is not None and cfs_period is not None:
        allowed, period = cfs_quota.strip(), cfs_period.strip()
    else:
        return None
    unlimited = allowed in {"max", "-1"}
    return Quota(None if unlimited else int(allowed) / int(period), throttled_us)
