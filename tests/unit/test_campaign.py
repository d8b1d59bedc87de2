"""Campaigns: what a file means, what a scenario becomes, what is kept, and what a dying worker costs."""

import csv
import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from hil.values.errors import ConfigurationError
from tests.support.cli import cli
from tests.support.processes import ROOT
from tools.campaign.local import play_locally
from tools.campaign.picture import draw
from tools.campaign.plan import load_plan
from tools.campaign.play import play
from tools.campaign.requirement import broken
from tools.campaign.scenario import Require, Row, Scenario, empty_row
from tools.campaign.store import ROWS, Store
from tools.campaign.summary import ARMS, first_failure, groups, worst_latencies, worst_margins

MOVES = """
import random, sys
from hil.client.servo import PTP, ServoClient
with ServoClient() as robot:
    robot.move(PTP([0.1, 0.6, 0.0, 0.9, 0.0, 1.3, 0.0]))
print("drew", random.random(), *sys.argv[1:])
"""
SINE = """
[[application]]
name = "sine"
run = "sine.py"
arguments = ["--seconds", "1.6"]
"""

SINE_PROGRAM = "import typer\nfrom apps.fri_joint_sine import main\ntyper.run(main)\n"
"""Not as a module: pytest's import hook cannot run one of ours as a program."""

Written = Callable[..., Path]


@pytest.fixture
def written(tmp_path: Path) -> Written:
    """Writes a campaign file, with programs beside it."""

    def write(text: str, **programs: str) -> Path:
        for name, program in programs.items():
            (tmp_path / f"{name}.py").write_text(program)
        file = tmp_path / "campaign.toml"
        file.write_text('robot = { backend = "ideal" }\n' + text)
        return file

    return write


def program(name: str, **keys: Any) -> str:
    lines = [f"{key} = {json.dumps(value)}" for key, value in keys.items()]
    return "\n".join([f'[[application]]\nname = "{name}"\nrun = "{name}.py"', *lines, ""])


def without_wall(row: Row) -> dict[str, object]:
    return {name: value for name, value in row.items() if name != "wall_s"}


def test_every_combination_is_a_scenario_but_what_an_application_leaves_out(written: Written) -> None:
    file = written(
        "seeds = [3, 5]\n"
        + program("a", impairments=["lossy"])
        + program("b", arguments=["-x"])
        + '[[impairment]]\nname = "perfect"\n[[impairment]]\nname = "lossy"\nfaults = ["loss=1%"]\n'
        + '[[gains]]\nname = "soft"\narguments = ["--soft"]\n'
        + '[[load]]\nname = "2 kg"\nmass_kg = 2.0\ncentre_mm = [0, 0, 50]\n',
        a=MOVES,
        b=MOVES,
    )
    scenarios = load_plan(file).scenarios
    assert [one.name for one in scenarios] == [
        "a/lossy/soft/2 kg/3", "a/lossy/soft/2 kg/5", "b/perfect/soft/2 kg/3", "b/perfect/soft/2 kg/5",
        "b/lossy/soft/2 kg/3", "b/lossy/soft/2 kg/5",
    ]  # fmt: skip
    assert scenarios[0].faults == ("loss=1%",)
    assert scenarios[2].arguments == ("-x", "--soft")
    assert scenarios[0].robot["load"]["mass_kg"] == scenarios[0].robot["tool"][0]["mass_kg"] == 2.0
    assert len({one.key for one in scenarios}) == 6


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "application: Field required"),
        ("bogus = 1\n" + program("a"), "bogus: "),
        (program("a", capture="x.pcapng"), "needs run or capture, one of them"),
        (program("a") + '[[impairment]]\nname = "x"\nfaults = ["loss=200%"]\n', "loss"),
        (program("a") + program("a"), "the name 'a' is given twice"),
        (program("a", gains=["none"]), "gains has 'none'; valid: default"),
        ("seeds = 0\n" + program("a"), "how many seeds (1 to 1000000)"),
        ("seeds = [1, 1]\n" + program("a"), "a seed is listed twice"),
        ("seeds = 2000000\n" + program("a"), "how many seeds (1 to 1000000)"),
        (program("missing"), "there is no file"),
        (program("a", robot={}).replace("{}", '{ mode = "T3" }'), "a/perfect/default/none: mode: "),
        (program("a") + '[[load]]\nname = "x"\nmass_kg = -1\n', "mass_kg"),
        ('station = "nowhere.toml"\n' + program("a"), "nowhere.toml"),
        (program("a/b"), "'a/b' is no name: 1 to 40 letters"),
        ("impairment = []\n" + program("a"), "impairment: "),
        ('robot_name = "left"\n' + program("a"), "robot_name is one of a station's"),
        (program("a", gains=[]), "application[1].gains: "),
        ("[[application]]\nname = 'a'\nrun = 'no.such'\n", "there is no module no.such that can be run"),
        ("[[application]]\nname = 'a'\nrun = 'json'\n", "there is no module json that can be run"),
        (program("a", robot={}).replace("{}", '{ model = "lbr-iiwa-77" }'), "unknown robot 'lbr-iiwa-77'"),
        (program("a", robot={}).replace("{}", '{ backend = "mojoco" }'), "mojoco"),
        (program("a", robot={}).replace("{}", '{ backend = "cabinet" }'), "cannot be in virtual time"),
        (program("a", robot={}).replace("{}", '{ servo = { key_file = "no.key" } }'), "no.key"),
    ],
)
def test_a_file_that_cannot_work_is_refused_before_anything_runs(written: Written, text: str, told: str) -> None:
    with pytest.raises(ConfigurationError) as refused:
        load_plan(written(text, a=MOVES))
    assert told in str(refused.value)


def test_one_mistake_is_told_once(written: Written) -> None:
    with pytest.raises(ConfigurationError) as refused:
        load_plan(written(program("a", argument="x"), a=MOVES))
    assert "application[1].argument: there is no such key (docs/campaigns.md lists all)" in str(refused.value)
    assert "at least 1 item" not in str(refused.value)


def test_more_scenarios_than_anybody_waits_for_are_refused(written: Written) -> None:
    axes = "".join(f'[[impairment]]\nname = "{number}"\n' for number in range(11))
    with pytest.raises(ConfigurationError, match="1100000 scenarios; 1000000 at most"):
        load_plan(written("seeds = 100000\n" + program("a") + axes, a=MOVES))


def test_a_scenario_gives_the_same_row_again_and_tells_what_it_did(written: Written) -> None:
    file = written("seeds = 2\n" + program("a", arguments=["b", "c"]), a=MOVES)
    first, second = load_plan(file).scenarios
    said: list[str] = []
    happened: list[str] = []
    row = play(first, say=said.append, events=happened.append)
    assert row["outcome"] == "passed"
    assert 0.3 < row["commanded_s"] < row["virtual_s"] < 5.0
    assert row["margin_monitor"] == "axis velocity"
    assert 0.0 < row["margin_used"] == row["axis_velocity_used"] < 1.0
    assert any("begins" in line for line in happened)
    again: list[str] = []
    assert without_wall(play(first, say=again.append)) == without_wall(row)
    assert again == said
    assert said[0].endswith(" b c")
    other: list[str] = []
    play(second, say=other.append)
    assert other != said, "the seed is that of the module random too"


@pytest.mark.parametrize(
    ("text", "outcome", "told"),
    [
        ("raise ValueError('no')", "failed", "ValueError: no"),
        ("import sys\nprint('a sentence')\nsys.exit(3)", "failed", "exit code 3: a sentence"),
        ("import sys\nsys.exit('a sentence')", "failed", "exit code 1: a sentence"),
        ("import time\nwhile True: time.sleep(1)", "timeout", "did not end within 2 s"),
        ("import sys\nsys.exit(0)", "passed", ""),
        ("\nraise ValueError('a \x1b[31mtwo\\n  lines')", "failed", "ValueError: a [31mtwo lines (a.py:2)"),
        ("print('│ No such option │')\nprint('╰──╯')\nraise SystemExit(2)", "failed", "exit code 2: No such option"),
        (SINE_PROGRAM, "timeout", "the application did not end within 2 s"),
    ],
)
def test_the_end_of_a_program_is_told(written: Written, text: str, outcome: str, told: str) -> None:
    row = play(load_plan(written("seconds = 2.0\n" + program("a"), a=text)).scenarios[0])
    assert row["outcome"] == outcome
    assert told in row["reason"]
    assert bool(told) == bool(row["reason"])


def test_a_network_that_costs_the_motion_is_a_failure_with_its_stop(written: Written) -> None:
    text = '[[impairment]]\nname = "dies"\nfaults = ["half-open=to-controller@1.3s.."]\n'
    row = play(load_plan(written("[require]\ncommanded = true\n" + SINE + text, sine=SINE_PROGRAM)).scenarios[0])
    assert row["outcome"] == "failed"
    assert row["stops"] == 1
    assert row["first_stop_s"] == pytest.approx(1.35, abs=0.02)
    assert "client lost" in row["first_stop"]
    assert row["faults_fired"] > 0
    assert row["answer_latency_p99_us"] == pytest.approx(200.0, rel=0.02)


def test_a_capture_speaks_again_where_its_arm_was(written: Written, tmp_path: Path) -> None:
    recorded = tmp_path / "run.pcapng"
    file = written(SINE, sine=SINE_PROGRAM)
    first = load_plan(file).scenarios[0]
    row = play(first, capture=recorded)
    assert row["outcome"] == "passed", row["reason"]
    again = written(
        '[require]\ncommanded = true\n[[application]]\nname = "recorded"\ncapture = "run.pcapng"\n'
        '[[impairment]]\nname = "perfect"\n[[impairment]]\nname = "lossy"\nfaults = ["loss=0.5%"]\n'
    )
    perfect, lossy = (play(one) for one in load_plan(again).scenarios)
    for one in (perfect, lossy):
        assert one["outcome"] == "passed", one["reason"]
    assert perfect["axis_velocity_used"] == pytest.approx(row["axis_velocity_used"], rel=1e-3)
    assert lossy["axis_velocity_used"] > 1.5 * perfect["axis_velocity_used"], "after a lost answer comes a larger step"
    assert lossy["faults_fired"] > 0
    assert lossy["answers"] < perfect["answers"]


def test_a_recorded_application_speaks_again(written: Written, tmp_path: Path) -> None:
    recorded = tmp_path / "run.pcapng"
    row = play(load_plan(written(program("a"), a=MOVES)).scenarios[0], capture=recorded)
    again = written('[require]\ncommanded = true\n[[application]]\nname = "recorded"\ncapture = "run.pcapng"\n')
    found = play(load_plan(again).scenarios[0])
    assert found["outcome"] == "passed", found["reason"]
    assert found["axis_velocity_used"] == pytest.approx(row["axis_velocity_used"], rel=1e-6)


def test_what_is_required_is_told_where_it_is_not_kept() -> None:
    scenario = Scenario("a", "b", "c", "d", 1, "m", (), None, (), {}, 1.0, Require())
    row = empty_row(scenario, "passed", "")
    require = Require(margin_used=0.8, answer_latency_p99_us=100.0, late_answers=3, commanded=True)
    assert broken(require, row) == "nobody commanded the arm"
    row |= {"commanded_s": 1.0, "margin_used": 0.81, "margin_monitor": "axis torque", "answer_latency_p99_us": 101.0}
    row |= {"late_answers": 4, "stops": 1, "first_stop_s": 0.5, "first_stop": "arm brakes: x"}
    told = broken(require, row)
    for part in ("1 stops (allowed: 0)", "81.0% of the limit of axis torque", "101 us", "4 late answers"):
        assert part in told
    assert not broken(Require(stops=1), row)


def test_a_worker_that_dies_costs_its_scenario_a_retry_and_one_that_hangs_nothing_else(
    written: Written, tmp_path: Path
) -> None:
    dies_once = "import os, pathlib, signal, sys\nmarker = pathlib.Path(sys.argv[1])\nif not marker.exists():\n"
    dies_once += "    marker.touch()\n    os.kill(os.getpid(), signal.SIGKILL)\n"
    file = written(
        program("well")
        + program("once", arguments=[str(tmp_path / "marker")])
        + program("always")
        + program("hangs")
        + program("interrupts"),
        well=MOVES,
        once=dies_once,
        always="import os\nos._exit(7)\n",
        hangs="while True: pass\n",
        interrupts="raise KeyboardInterrupt",
    )
    scenarios = load_plan(file).scenarios
    rows = {row["application"]: row for row in play_locally(scenarios, workers=2, patience_s=1.5, retries=1)}
    assert rows["well"]["outcome"] == "passed"
    assert (rows["once"]["outcome"], rows["once"]["attempts"]) == ("passed", 2)
    assert (rows["always"]["outcome"], rows["always"]["attempts"]) == ("worker-died", 2)
    assert rows["always"]["reason"] == "its worker died with exit code 7"
    assert (rows["hangs"]["outcome"], rows["hangs"]["reason"]) == ("hung", "took longer than 1.5 s")
    assert rows["hangs"]["wall_s"] == 1.5
    assert (rows["interrupts"]["outcome"], rows["interrupts"]["reason"]) == ("failed", "KeyboardInterrupt")


def some_rows() -> list[Row]:
    rows = []
    for number, (application, impairment) in enumerate([("a", "x"), ("a", "y"), ("b", "x"), ("a", "x")]):
        scenario = Scenario(application, impairment, "g", "l", number, "m", (), None, (), {}, 1.0, Require())
        row = empty_row(scenario, "passed" if number != 2 else "failed", "" if number != 2 else "why")
        row |= {"margin_used": 0.1 * number, "answer_latency_p99_us": 100.0 * number if number else None}
        rows.append(row)
    return rows


def test_rows_are_kept_and_a_torn_one_is_not(tmp_path: Path) -> None:
    rows = some_rows()
    with Store(tmp_path) as store:
        for row in rows[:3]:
            store.add(row)
        with pytest.raises(ConfigurationError, match="another campaign writes to"):
            Store(tmp_path)
    file = tmp_path / ROWS
    file.write_text(file.read_text()[:-20])
    with Store(tmp_path) as store:
        assert [*store.rows] == [row["key"] for row in rows[:2]]
        store.add(rows[3])
    with Store(tmp_path) as store:
        assert [*store.rows.values()] == [*rows[:2], rows[3]]
    with Store(tmp_path, fresh=True) as store:
        assert not store.rows
    (tmp_path / "file").touch()
    with pytest.raises(ConfigurationError, match="cannot keep results in"):
        Store(tmp_path / "file")


def test_the_worst_are_found_and_drawn(tmp_path: Path) -> None:
    rows = some_rows()
    assert [(*group.names, group.passed) for group in groups(rows)] == [
        ("a", "x", 2), ("a", "y", 1), ("b", "x", 0),
    ]  # fmt: skip
    assert [(group.names, group.passed) for group in groups(rows, ARMS)] == [(("g", "l"), 3)]
    assert [row["seed"] for row in worst_margins(rows)] == [3, 2, 1]
    assert [row["seed"] for row in worst_latencies(rows, 2)] == [3, 2]
    assert first_failure(rows) is rows[2]
    draw(rows, tmp_path / "picture.png", title="a title")
    assert (tmp_path / "picture.png").stat().st_size > 10_000


def test_the_command_goes_on_where_it_was_and_names_the_first_failure(
    written: Written, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    written(
        "seconds = 2.0\n" + program("well") + program("bad"), well=MOVES, bad="print('before')\nraise ValueError('no')"
    )
    once = cli("campaign", "campaign.toml", "--workers", "1", "--json", "sum.json")
    assert once.code == 1
    assert "hil campaign campaign.toml --scenario bad/perfect/default/none/1" in once.out
    summary = json.loads((tmp_path / "sum.json").read_text())
    assert summary["outcomes"] == {"passed": 1, "failed": 1}
    assert summary["first_failure"]["reason"] == "ValueError: no (bad.py:2)"
    out = tmp_path / "campaign-results"
    with (out / "results.csv").open(newline="") as stream:
        table = list(csv.DictReader(stream))
    assert [row["outcome"] for row in table] == ["passed", "failed"]
    columns = pq.read_table(out / "results.parquet").to_pylist()
    assert [row["scenario"] for row in columns] == [row["scenario"] for row in table]
    before = (out / ROWS).read_text()
    again = cli("campaign", "campaign.toml")
    assert "2 of 2 scenarios are in campaign-results already" in again.out
    assert (out / ROWS).read_text() == before
    one = cli("campaign", "campaign.toml", "--scenario", "bad/perfect/default/none/1", "--capture", "bad.pcapng")
    assert one.code == 1
    assert "ValueError: no" in one.out
    assert "| before" in one.out
    assert "line 2" in one.out, "a traceback"
    assert (tmp_path / "bad.pcapng").stat().st_size > 0
    wrong = cli("campaign", "campaign.toml", "--scenario", "bad/perfect")
    assert wrong.code == 2


def test_the_key_changes_with_everything_that_changes_the_row(written: Written) -> None:
    scenario = load_plan(written(program("a"), a=MOVES)).scenarios[0]
    changes: tuple[dict[str, Any], ...] = (
        {"seed": 9},
        {"seconds": 1.0},
        {"faults": ("loss=1%",)},
        {"robot": {}},
        {"require": Require(stops=1)},
        {"content": "other"},
    )
    for change in changes:
        assert dataclasses.replace(scenario, **change).key != scenario.key


@pytest.mark.parametrize("changed", ["a.py", "beside.py", "package/part.py", "data.csv", "module/part.py"])
def test_a_program_that_was_changed_is_played_again(
    written: Written, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changed: str
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("package", "module"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").touch()
    for name in ("beside.py", "package/part.py", "module/part.py", "module/app.py", "data.csv", "other.csv"):
        (tmp_path / name).write_text("1")
    file = written(program("a", arguments=["--data", "data.csv"]), a=MOVES)
    if changed.startswith("module"):
        file = written('[[application]]\nname = "a"\nrun = "module.app"\n')
    before, again = (load_plan(file).scenarios[0] for _ in range(2))
    (tmp_path / "other.csv").write_text("2")
    assert before.key == again.key == load_plan(file).scenarios[0].key
    (tmp_path / changed).write_text(MOVES + "2")
    after = load_plan(file).scenarios[0]
    assert before.name == after.name
    assert before.key != after.key


def test_a_command_that_was_refused_is_a_limit_that_was_used_up(written: Written) -> None:
    fast = SINE.replace('"1.6"', '"3", "--frequency", "8", "--amplitude", "1.5"')
    row = play(load_plan(written("[require]\nstops = 9\nmargin_used = 0.9\n" + fast, sine=SINE_PROGRAM)).scenarios[0])
    assert (row["margin_used"], row["margin_monitor"]) == (1.0, "axis velocity (refused)")
    assert "100.0% of the limit of axis velocity (refused) used (allowed: 90.0%)" in row["reason"]


def test_a_scenario_that_hung_is_tried_again_with_more_patience_only(tmp_path: Path) -> None:
    scenario = Scenario("a", "b", "c", "d", 1, "m", (), None, (), {}, 1.0, Require())
    with Store(tmp_path) as store:
        assert not store.has(scenario, patience_s=1.0)
        for outcome, there in (("hung", True), ("worker-died", False), ("failed", True)):
            store.add({**empty_row(scenario, outcome, ""), "wall_s": 6.0})
            assert store.has(scenario, patience_s=6.0) is there
        store.add({**empty_row(scenario, "hung", ""), "wall_s": 6.0})
        assert not store.has(scenario, patience_s=7.0)
    with (tmp_path / ROWS).open("ab") as stream:
        stream.write(b"\xff\xfe\n")
    with Store(tmp_path) as store:
        assert store.has(scenario, patience_s=6.0)


def test_the_example_can_be_played() -> None:
    scenarios = load_plan(ROOT / "examples" / "campaign" / "campaign.toml").scenarios
    assert len(scenarios) == 81
    assert "81 scenarios" in (ROOT / "docs" / "campaigns.md").read_text()
