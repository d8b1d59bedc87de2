"""What a machine says of itself, from recorded texts, and what the doctor makes of it."""

from dataclasses import replace
from typing import Any

import pytest

from hil.runtime.pacer import Tick
from hil.values.finding import Diagnosis, Severity, Whose
from tools.doctor.host import readings
from tools.doctor.host.condition import BusyProcess, Condition, Look, busiest, look, over
from tools.doctor.host.lateness import Lateness
from tools.doctor.host.readings import CpuTimes, ProcessTime, Quota
from tools.doctor.host.verdict import judge

MS = 1_000_000
STAT = """\
cpu  2509798 26121 142414 6513600 17074 0 6784 2943 0 0
cpu0 1095344 13989 58362 3430296 2841 0 2926 1451 0 0
intr 20599874 0 0
"""
SNMP = """\
Ip: Forwarding DefaultTTL InReceives
Ip: 2 64 8318017
Udp: InDatagrams NoPorts InErrors OutDatagrams RcvbufErrors SndbufErrors InCsumErrors IgnoredMulti MemErrors
Udp: 5437 2 31 5500 31 0 0 0 0
UdpLite: InDatagrams NoPorts InErrors OutDatagrams RcvbufErrors SndbufErrors InCsumErrors IgnoredMulti MemErrors
UdpLite: 0 0 0 0 0 0 0 0 0
"""
PRESSURE = """\
some avg10=3.26 avg60=3.76 avg300=4.77 total=3163816143
full avg10=0.00 avg60=0.00 avg300=0.00 total=0
"""
PROCESS = (
    "4321 (python (busy) x) S 1 1 1 0 -1 4194560 225803 164576751 0 35124 2984 7816 2453964 129783 10 -10 13 0 2587 "
    "54730752 5207 18446744073709551615 1 1 0 0 0 0 0 4096 1256 0 0 0 17 1 0 0 0 0 0 0 0 0 0 0 0 0 0\n"
)
CGROUP_1 = "3:cpuset:/\n2:cpuacct,cpu:/docker/f3da\n0::/\n"
CGROUP_2 = "0::/user.slice/session-2.scope\n"
QUIET = Condition(
    system="Linux 6.1",
    cpus=4,
    cpus_allowed=4,
    scheduling="SCHED_OTHER, nice 0",
    realtime_priority_limit=0,
    may_change_priority=False,
    locked_memory_limit_bytes=8 << 20,
    governor="performance",
    virtual=False,
    preemption="PREEMPT_DYNAMIC",
    timer_slack_ns=50_000,
    receive_buffer_max_bytes=4 << 20,
    receive_buffer_default_bytes=208 << 10,
    one_minute_load=0.1,
    stolen_share=0.0,
    busy_share=0.02,
    waited_share=0.0001,
    preempted=3,
    pressure_share=0.0,
    quota_cpus=None,
    throttled_share=0.0,
    receive_errors=0,
    swapped_pages=0,
)


def test_the_kernel_s_texts_are_read() -> None:
    assert readings.cpu_times(STAT) == CpuTimes(total=9218734, idle=6530674, stolen=2943)
    assert readings.udp_receive_buffer_errors(SNMP) == 31
    assert readings.pressure_us(PRESSURE) == 3163816143
    assert readings.waited_ns("465249 386162 2\n") == 386162
    assert readings.process_time(PROCESS) == ProcessTime("python (busy) x", 2984 + 7816, began=2587, cpu=1)
    assert readings.swapped_pages("pgpgin 5\npswpin 12\npswpout 30\n") == 42
    assert readings.one_minute_load("0.91 1.16 1.18 1/119 23200\n") == 0.91
    assert readings.is_virtual("processor\t: 0\nflags\t\t: fpu hypervisor lahf_lm\n") is True
    assert readings.is_virtual("flags\t\t: fpu lahf_lm\n") is False
    assert readings.may_change_priority("Name:\thead\nCapEff:\t000001ffffffffff\n") is True
    assert readings.may_change_priority("CapEff:\t0000000000000000\n") is False
    assert readings.preemption("#1 SMP PREEMPT_DYNAMIC @0", None) == "PREEMPT_DYNAMIC"
    assert readings.preemption("#1 SMP", "1\n") == "PREEMPT_RT"
    assert readings.governors(["powersave\n", "performance\n", "powersave\n"]) == "performance, powersave"
    assert readings.group_paths(CGROUP_2)[0] == "/sys/fs/cgroup/user.slice/session-2.scope"
    assert readings.group_paths(CGROUP_1)[:2] == (
        "/sys/fs/cgroup/cpuacct,cpu/docker/f3da",
        "/sys/fs/cgroup/cpuacct,cpu",
    )
    assert readings.quota("150000 100000\n", None, None, "throttled_usec 77\n") == Quota(1.5, 77)
    assert readings.quota("max 100000\n", None, None, "usage_usec 5\n") == Quota(None, 0)
    assert readings.quota(None, "-1\n", "100000\n", "nr_throttled 2\nthrottled_time 5000\n") == Quota(None, 5)


@pytest.mark.parametrize("text", ["", "\n", "something else entirely\n", "cpu 1 2\nUdp: x\n"])
def test_what_a_text_does_not_say_is_not_guessed(text: str) -> None:
    found = [
        readings.cpu_times(text), readings.udp_receive_buffer_errors(text), readings.pressure_us(text),
        readings.process_time(text), readings.swapped_pages(text), readings.is_virtual(text),
        readings.may_change_priority(text), readings.preemption(text, None), readings.quota(None, None, None, text),
    ]  # fmt: skip
    assert found == [None] * len(found)
    assert readings.governors([]) is None


def moment(at_ns: int, **more: Any) -> Look:
    base = Look(at_ns, CpuTimes(1000, 500, 10), 0, 0, 0, Quota(None, 0), 0, 0, {})
    return base._replace(**more)


def test_what_happened_lies_between_two_looks() -> None:
    after = moment(
        2_000_000_000, cpu=CpuTimes(1400, 800, 58), waited_ns=90_000_000, preempted=7, pressure_us=100_000,
        quota=Quota(0.5, 500_000), receive_errors=3, swapped_pages=4,
    )  # fmt: skip
    found = over(moment(0), after)
    shares = [found.stolen_share, found.busy_share, found.waited_share, found.pressure_share, found.throttled_share]
    assert shares == pytest.approx([0.12, 0.25, 0.045, 0.05, 0.25])
    assert found.quota_cpus == 0.5
    assert (found.preempted, found.receive_errors, found.swapped_pages) == (7, 3, 4)
    nothing = moment(5, cpu=None, waited_ns=None, preempted=None, pressure_us=None, quota=None, receive_errors=None)
    found = over(nothing, nothing)
    assert (found.stolen_share, found.waited_share, found.throttled_share, found.receive_errors) == (None,) * 4


def test_the_busiest_are_told_and_a_new_process_with_an_old_number_is_new() -> None:
    before = {
        1: ProcessTime("calm", 5000, began=10, cpu=0),
        2: ProcessTime("gone", 90, began=10, cpu=0),
        3: ProcessTime("busy", 1000, began=10, cpu=1),
    }
    after = {
        1: ProcessTime("calm", 5004, began=10, cpu=0),
        2: ProcessTime("reused", 30, began=999, cpu=0),
        3: ProcessTime("busy", 1196, began=10, cpu=1),
    }
    busy, reused = BusyProcess(3, "busy", 0.98), BusyProcess(2, "reused", 0.15)
    assert busiest(before, after, allowed=None, took_ns=2_000_000_000, ticks_per_s=100) == (busy, reused)
    assert busiest(before, after, allowed={0}, took_ns=2_000_000_000, ticks_per_s=100) == (reused,)
    assert busiest({}, {}, allowed=None, took_ns=1, ticks_per_s=100) is None


def test_this_machine_can_be_looked_at() -> None:
    before = look()
    found = over(before, look())
    assert found.cpus >= 1
    assert found.system


def timing(late_us: int = 80, *, stalls: int = 0, stall_ms: int = 0, cycles: int = 5000) -> Lateness:
    """Return what a timer did: always as late, and a few stalls."""
    found = Lateness(MS)
    while found.cycles < cycles - stalls * (stall_ms + 1):
        found.book(Tick(0, late_us * 1000, 0))
    for _ in range(stalls):
        found.book(Tick(0, 300_000, stall_ms))
    return found


def judged(lateness: Lateness, **condition: Any) -> Diagnosis:
    return judge(lateness, replace(QUIET, **condition))


def test_a_stall_is_booked_as_the_lateness_of_every_cycle_it_went_over() -> None:
    found = timing(stalls=1, stall_ms=12)
    assert (found.cycles, found.missed, found.stalls) == (5000, 12, 1)
    assert found.late.count == 5000
    assert found.late.maximum == 12_300_000


def test_a_host_that_holds_the_cycle() -> None:
    diagnosis = judged(timing(80))
    assert diagnosis.healthy
    verdict = diagnosis.verdict
    assert verdict.sentence == (
        "this host can hold 1 kHz: lateness p99 80 us (bound 200), longest 80 us, 0 of 5000 cycles missed"
    )
    assert verdict.remedies == ()
    assert verdict.figures["lateness_p99_us"] == 80.0
    readings_of = {row[0]: row[1] for row in diagnosis.tables[1].rows}
    assert readings_of["frequency governor"] == "performance"
    assert readings_of["CPUs"] == "4, this process may use 4"


PYTHON = BusyProcess(4321, "python", 0.98)


@pytest.mark.parametrize(
    ("condition", "why", "remedy"),
    [
        (
            {"stolen_share": 0.12},
            "the hypervisor took 12.0 % of the CPUs' time for others (steal)",
            "pin its CPUs there",
        ),
        (
            {"waited_share": 0.05, "busiest": (PYTHON,)},
            (
                "its process was ready to run and had no CPU 5.0 % of the time; "
                "others took it: python (4321) 98 % of one CPU"
            ),
            "stop what competes, or keep it off a CPU",
        ),
        (
            {"throttled_share": 0.3, "quota_cpus": 0.5, "waited_share": 0.1},
            "its control group was held back 30.0 % of the time by its quota of 0.5 CPUs",
            "give the container more CPU",
        ),
        ({"swapped_pages": 900}, "900 pages were swapped meanwhile", "more memory, or no swap"),
        (
            {"governor": "powersave"},
            "the governor powersave lets the CPUs sleep or slow down between two cycles",
            "hil run --realtime, once it is allowed: a line '@realtime - rtprio 80'",
        ),
        (
            {"may_change_priority": True},
            "no other process had its CPU, so it is the kernel, its drivers or the power saving of the CPUs",
            "hil run --realtime: SCHED_FIFO is allowed here",
        ),
        ({"virtual": True, "realtime_priority_limit": 99}, "or the hypervisor", "SCHED_FIFO is allowed here"),
        ({"waited_share": None}, "why is not known here", "hil run --realtime"),
        ({"scheduling": "SCHED_FIFO priority 80"}, "no other process had its CPU", "a kernel with PREEMPT_RT"),
    ],
)
def test_a_host_that_cannot_says_why_and_the_best_remedy_first(
    condition: dict[str, Any], why: str, remedy: str
) -> None:
    verdict = judged(timing(80, stalls=5, stall_ms=4), **condition).verdict
    assert (verdict.kind, verdict.whose, verdict.severity) == ("host-timing", Whose.HOST, Severity.FAULT)
    assert verdict.sentence.startswith("this host cannot hold 1 kHz: 0.4 % of the cycles missed; lateness p99 ")
    assert "longest 4.3 ms, 20 of 5000 cycles missed; " in verdict.sentence
    assert why in verdict.sentence
    assert remedy in verdict.remedies[0]


def test_lateness_alone_is_enough_and_the_bound_goes_with_the_cycle() -> None:
    late = timing(250)
    assert judged(late).verdict.sentence.startswith(
        "this host cannot hold 1 kHz: lateness p99 250 us (bound 200), longest 250 us, 0 of 5000 cycles missed; "
    )
    late.cycle_ns = 5 * MS
    assert judged(late).verdict.sentence.startswith("this host can hold 200 Hz: lateness p99 250 us (bound 1000)")


def test_dropped_datagrams_and_small_buffers_are_told_beside_the_timing() -> None:
    diagnosis = judged(timing(80), receive_errors=31, receive_buffer_max_bytes=128 << 10)
    assert [(one.kind, one.severity) for one in diagnosis.findings] == [
        ("host-timing", Severity.GOOD),
        ("receive-buffer", Severity.WARNING),
        ("receive-buffer-limit", Severity.NOTE),
    ]
    assert "this host dropped 31 UDP datagrams meanwhile" in diagnosis.findings[1].sentence
    assert diagnosis.findings[2].remedies == ("sysctl -w net.core.rmem_max=262144",)
    assert not diagnosis.healthy


def test_what_is_not_known_is_told_so() -> None:
    bare = Condition(
        "Darwin 23.1", 8, None, None, None, None, None, None, None, None, None, None, None, None
    )  # fmt: skip
    rows = {row[0]: row[1] for row in judge(timing(80), bare).tables[1].rows}
    assert rows["CPUs"] == "8"
    known = {"system", "CPUs"}
    assert {what for what, reading in rows.items() if reading != "not known here"} == known
    assert judge(timing(900), bare).verdict.sentence.endswith("; why is not known here")
