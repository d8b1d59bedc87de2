"""``each_packet`` and the fixtures, as pytest runs them: how often, how fresh, and how it says what failed."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import hil.testkit.controller  # noqa: F401  # pytester forgets what it imported, and numpy cannot be imported twice
from hil.testkit._sweep import Which
from hil.values.errors import UsageError
from tests.support.processes import ROOT
from tests.support.virtual_controller import PLUGIN

pytest_plugins = ["pytester"]

CLIENT = """
import pytest
from hil.client.fri import FriHandler
from hil.client.servo import PTP, ServoClient
from hil.testkit import Loss

def move(by_rad=0.005):
    with ServoClient() as robot:
        goal = list(robot.read_state().measured_position)
        goal[0] += by_rad
        robot.move(PTP(goal).set_joint_velocity_rel(1.0))
    return goal

pytestmark = pytest.mark.hil(fri=None)
"""


def ran(pytester: pytest.Pytester, tests: str, *options: str) -> pytest.RunResult:
    pytester.makepyfile(CLIENT + tests)
    return pytester.runpytest_inprocess(*PLUGIN, "-p", "no:asyncio", "-W", "error", "--strict-markers", *options)


def packets(result: pytest.RunResult) -> tuple[int, int]:
    """How many packets the first run had, as the test printed it: to the controller, to the peer."""
    found = re.search(r"packets=(\d+),(\d+)", result.stdout.str())
    assert found is not None
    return int(found[1]), int(found[2])


COUNTING = """
runs = []

@pytest.fixture
def own(hil_controller):
    return [hil_controller]

@pytest.fixture(scope="module")
def wide():
    return []

class TestCounting:
    fresh = True

    {marks}
    def test_counts(self, own, wide, hil_controller, tmp_path):
        assert own == [hil_controller] and self.fresh and not list(tmp_path.iterdir())
        self.fresh = False
        (tmp_path / "mark").touch()
        goal = move()
        assert abs(hil_controller.measured_position_rad[0] - goal[0]) < 1e-6
        fired = [str(report) for report in hil_controller.network.reports()]
        runs.append((id(hil_controller), fired, dict(hil_controller.network.packets)))
        wide.append(1)

def test_afterwards(capsys):
    counts = list(runs[0][2].values())
    with capsys.disabled():
        print("packets=%d,%d" % tuple(counts))
        for _, fired, _ in runs:
            print("run", fired)
        print("wide", len(runs))
"""


@pytest.mark.parametrize(("action", "every"), [("drop", 1), ("delay", 5), ("duplicate", 5), ("corrupt", 5)])
def test_a_test_is_repeated_once_for_each_packet(pytester: pytest.Pytester, action: str, every: int) -> None:
    result = ran(pytester, COUNTING.format(marks=f"@pytest.mark.each_packet({action!r}, every={every})"))
    result.assert_outcomes(passed=2)
    counts = dict(zip(("to-controller", "to-peer"), packets(result), strict=True))
    assert counts["to-controller"] > 5
    assert counts["to-peer"] > 10
    lines = [line for line in result.outlines if line.startswith("run ")]
    assert lines[0] == "run []"
    hit = [match.groups() for line in lines if (match := re.search(r"packet=(\S+)@(\d+)\S*:(\S+): fired on 1", line))]
    assert hit == [
        (action, str(number), direction) for direction, count in counts.items() for number in range(0, count, every)
    ]
    assert len(lines) == 1 + len(hit)


def test_marks_choose_direction_and_packets_and_add_up(pytester: pytest.Pytester) -> None:
    marks = """@pytest.mark.each_packet("drop", direction="to-peer", every=3, only=range(3, 13))
    @pytest.mark.each_packet("delay", "duplicate", direction="to-controller", only=range(2), delay_ms=7)"""
    result = ran(pytester, COUNTING.format(marks=marks))
    hit = re.findall(r"packet=(\S+): fired", result.stdout.str())
    assert hit == [
        *(f"drop@{number}:to-peer" for number in (3, 6, 9, 12)),
        *(f"delay@{number}+7ms:to-controller" for number in range(2)),
        *(f"duplicate@{number}:to-controller" for number in range(2)),
    ]


@pytest.mark.parametrize(
    ("option", "hit"),
    [
        ("1", ["drop@1:to-controller", "drop@1:to-peer", "corrupt@1:to-controller", "corrupt@1:to-peer"]),
        ("to-peer:1", ["drop@1:to-peer", "corrupt@1:to-peer"]),
        ("drop:to-peer:1", ["drop@1:to-peer"]),
        ("none", []),
    ],
)
def test_an_option_chooses_one_packet(pytester: pytest.Pytester, option: str, hit: list[str]) -> None:
    tests = COUNTING.format(marks='@pytest.mark.each_packet("drop", "corrupt")')
    result = ran(pytester, tests, "--each-packet", option)
    result.assert_outcomes(passed=2)
    assert re.findall(r"packet=(\S+): fired", result.stdout.str()) == hit


FRAGILE = """
class NeedsEveryMessage(FriHandler):
    last = None

    def monitor(self, state):
        assert self.last in (None, state.sequence_counter - 1), "a message was skipped"
        self.last = state.sequence_counter

@pytest.mark.hil(servo=None, fri={"send_period_ms": 10})
@pytest.mark.each_packet("drop", direction="to-peer", only=range(4, 7))
def test_fragile(hil_controller):
    hil_controller.attach_fri(NeedsEveryMessage())
    hil_controller.run(0.2)

@pytest.mark.hil(servo=None, fri={"send_period_ms": 10})
@pytest.mark.each_packet("drop")
def test_fragile_all_over(hil_controller):
    hil_controller.attach_fri(NeedsEveryMessage())
    hil_controller.run(0.2)

@pytest.mark.each_packet("drop", only=range(3))
def test_sound(hil_controller):
    move()
"""


def test_a_client_that_only_survives_without_loss_is_found(pytester: pytest.Pytester) -> None:
    result = ran(pytester, FRAGILE)
    result.assert_outcomes(passed=1, failed=13)
    out = result.stdout.str()
    file = "test_a_client_that_only_survives_without_loss_is_found.py"
    failed = re.findall(r"^FAILED \S+::test_fragile\[(\S+)\]", out, re.MULTILINE)
    assert failed == [f"drop-to-peer-{number}" for number in (4, 5, 6)]
    # Only pytest's own lines of the failure: its summary repeats the sentence where the line is wide enough, or in CI.
    assert len(re.findall(r"^E +AssertionError: a message was skipped", out, re.MULTILINE)) == 13
    assert re.findall(r"\[ *(\d+)%\]", out)[-1] == "100"
    result.stdout.fnmatch_lines(
        [
            "*test_fragile[[]drop-to-peer-5[]]*",
            "repetition 2 of 3: packet=drop@5:to-peer",
            f"only this one: pytest '{file}::test_fragile' --each-packet drop:to-peer:5",
            "packet=drop@5:to-peer: fired on 1 of * packets*",
        ]
    )
    assert out.count("10 repetitions failed; the others were not tried") == 1
    again = pytester.runpytest_inprocess(
        *PLUGIN, "-p", "no:asyncio", f"{file}::test_fragile", "--each-packet", "drop:to-peer:5"
    )
    again.assert_outcomes(failed=1)
    last_failed = pytester.runpytest_inprocess(*PLUGIN, "-p", "no:asyncio", "--last-failed", "--each-packet", "none")
    last_failed.assert_outcomes(passed=2)


def test_maxfail_ends_a_sweep(pytester: pytest.Pytester) -> None:
    ran(pytester, FRAGILE, "--exitfirst").assert_outcomes(failed=1)


def test_a_sweep_does_not_begin_when_the_undisturbed_run_fails(pytester: pytest.Pytester) -> None:
    result = ran(
        pytester,
        """
@pytest.mark.each_packet("drop")
def test_it(hil_controller):
    move()
    print("ran")
    assert False

@pytest.mark.each_packet("drop")
def test_skipped(hil_controller):
    pytest.skip("not today")

@pytest.mark.each_packet("drop")
def test_silent(hil_controller):
    pass
""",
    )
    result.assert_outcomes(failed=2, skipped=1)
    assert result.stdout.str().count("ran\n") == 1
    result.stdout.fnmatch_lines(["*each_packet has no packet to hit*0 to-controller, 0 to-peer*"])


NEVER = """
def test_fault(hil_network):
    hil_network.arm(Loss(0.5))

def test_action(hil_controller):
    hil_controller.when(lambda: False, hil_controller.shut_down)

def test_failed_for_another_reason(hil_network):
    hil_network.arm(Loss(0.5))
    assert False, "mine"

def test_fired(hil_network):
    hil_network.arm("loss=50%:to-controller")
    move()
"""


def test_what_never_happened_fails_its_test(pytester: pytest.Pytester) -> None:
    result = ran(pytester, NEVER)
    result.assert_outcomes(passed=1, failed=3)
    result.stdout.fnmatch_lines(
        [
            "never fired: loss=50%; packets that entered: 0 to-controller, 0 to-peer",
            "never came before the test ended at 0.000 s: the condition of the action that waits since 0.000 s",
        ]
    )
    failures = result.stdout.str().split("test_failed_for_another_reason")[1]
    assert "never fired" not in failures.split("test_fired")[0].split("short test summary")[0].split("mine")[0]


def test_module_fixtures_live_through_a_sweep_and_end_after_it(pytester: pytest.Pytester) -> None:
    result = ran(
        pytester,
        """
@pytest.fixture(scope="module")
def wide():
    print("wide begins")
    yield
    print("wide ends")
    raise RuntimeError("at the end")

@pytest.mark.each_packet("drop", only=range(2))
def test_it(wide, hil_controller):
    move()
    print("ran")
""",
        "-s",
    )
    result.assert_outcomes(passed=1, errors=1)
    told = re.findall(r"^(?:\S+\.py |\.)?(wide begins|ran|wide ends)$", result.stdout.str(), re.MULTILINE)
    assert told == ["wide begins", *["ran"] * 5, "wide ends"]


def test_it_works_in_workers_of_xdist(pytester: pytest.Pytester) -> None:
    result = ran(pytester, FRAGILE, "-n", "1", "-k", "not all_over")
    result.assert_outcomes(passed=1, failed=3)
    result.stdout.fnmatch_lines(["FAILED *::test_fragile[[]drop-to-peer-4[]]*"])


@pytest.mark.parametrize(
    ("test", "sentence"),
    [
        ("@pytest.mark.each_packet()\ndef test_it(hil_controller): pass", "each_packet needs an action"),
        ("@pytest.mark.each_packet('lose')\ndef test_it(hil_controller): pass", "'lose'; valid: drop, delay"),
        ("@pytest.mark.each_packet('drop', ever=2)\ndef test_it(hil_controller): pass", "'ever'; valid: direction"),
        ("@pytest.mark.each_packet('drop', every=0)\ndef test_it(hil_controller): pass", "every=0"),
        ("@pytest.mark.each_packet('drop', only=[3])\ndef test_it(hil_controller): pass", "only=[[]3[]]"),
        (
            "@pytest.mark.each_packet('drop', direction='up')\ndef test_it(hil_controller): pass",
            "direction 'up'; valid",
        ),
        ("@pytest.mark.each_packet('delay', delay_ms=0)\ndef test_it(hil_controller): pass", "delay of the packet"),
        ("@pytest.mark.each_packet('drop')\ndef test_it(tmp_path): pass", "needs the fixture hil_controller"),
    ],
)
def test_a_mark_that_cannot_work_is_one_sentence(pytester: pytest.Pytester, test: str, sentence: str) -> None:
    result = ran(pytester, test)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines([f"ERROR: *::test_it: *{sentence}*"])


@pytest.mark.parametrize("text", ["x", "drop:", "drop:drop:3", "up:3", "drop:to-peer:-1", ""])
def test_an_option_that_cannot_be_is_one_sentence(text: str) -> None:
    with pytest.raises(UsageError, match="a packet number is needed"):
        Which.parse(text)


def test_bad_configurations_fail_the_test_that_has_them(pytester: pytest.Pytester) -> None:
    result = ran(
        pytester,
        """
@pytest.mark.hil(robot="lbr-99")
def test_robot(hil_controller): pass

@pytest.mark.hil(speed=3)
def test_key(hil_controller): pass

@pytest.mark.hil("no/such/station.toml")
def test_file(hil_controller): pass

def test_both(hil_controller, hil_process): pass

@pytest.mark.hil(capture="no/such/folder/run.pcapng")
def test_capture(hil_controller): pass

@pytest.mark.hil(limit_s=0)
def test_limit(hil_controller): pass
""",
    )
    result.assert_outcomes(errors=6)
    result.stdout.fnmatch_lines(["*capture no/such/folder/run.pcapng: cannot be created: there is no folder*"])
    result.stdout.fnmatch_lines(["*more than 0 s is needed*"])
    result.stdout.fnmatch_lines(["*unknown robot 'lbr-99'; valid: lbr-iiwa-7-r800*"])
    result.stdout.fnmatch_lines(["*speed: there is no such key*"])
    result.stdout.fnmatch_lines(["*cannot read station file no/such/station.toml*"])
    result.stdout.fnmatch_lines(["*one test has a virtual controller or a process*"])


def test_a_station_file_beside_the_test_is_found_and_keys_are_laid_over_it(pytester: pytest.Pytester) -> None:
    folder = pytester.mkdir("cell")
    Path(folder, "station.toml").write_text(
        '[[robot]]\nname = "left"\nbackend = "ideal"\nmodel = "lbr-med-7"\n[robot.fri]\nrelease = "2.5"\n'
        'send_period_ms = 5\n\n[[robot]]\nname = "right"\n[robot.servo]\nbind = "127.0.0.1:0"\n'
    )
    Path(folder, "test_cell.py").write_text("""
import pytest

pytestmark = pytest.mark.hil("station.toml", robot_name="left", fri={"send_period_ms": 10})

@pytest.mark.hil(mode="T1", fri={"receive_multiplier": 2})
def test_it(hil_controller):
    config = hil_controller.config
    assert (config.model, config.mode, config.servo) == ("lbr-med-7", "T1", None)
    assert (config.fri.release, config.fri.send_period_ms, config.fri.receive_multiplier) == ("2.5", 10, 2)
""")
    Path(folder, "test_two.py").write_text("""
import pytest

@pytest.mark.hil("station.toml")
def test_it(hil_controller): pass

@pytest.mark.hil("station.toml", robot_name="middle")
def test_name(hil_controller): pass
""")
    result = pytester.runpytest_inprocess(*PLUGIN, "-p", "no:asyncio")
    result.assert_outcomes(passed=1, errors=2)
    result.stdout.fnmatch_lines(["*has the robots left, right; choose one with robot_name=*"])
    result.stdout.fnmatch_lines(["*unknown robot 'middle'; valid: left, right*"])


def test_loading_the_plugin_imports_nothing_heavy() -> None:
    script = (
        "import sys, pytest; before = set(sys.modules); import hil.testkit.plugin; "
        "print(*sorted(name for name in set(sys.modules) - before if name.count('.') == 0 or name.startswith('hil')))"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.split() == [
        "hil", "hil.testkit", "hil.testkit._stash", "hil.testkit.plugin", "hil.values", "hil.values.errors",
        "hil.values.outcomes",
    ]  # fmt: skip
