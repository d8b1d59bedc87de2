"""Backends of other packages: found, told apart, and refused in words where they cannot be used; ``hil backends``."""

import json
from pathlib import Path
from typing import Any

import pytest

from backends.installed import installed_backend
from backends.registry import backend_names, check_backend, load_plugin, make_backend
from backends.robots import load_description
from hil.client.servo import PTP, ServoClient
from hil.testkit import VirtualController
from hil.testkit._configuration import configuration
from hil.values.backend import BackendRequest
from hil.values.errors import ConfigurationError, UnknownName
from tests.support.cli import cli
from tests.support.offered import offer

GOOD = """
from backends.plugins import IDEAL
from dataclasses import replace
PLUGIN = replace(IDEAL, summary="an arm of \\x1b[31mpaper[/red]", options_help={"fold": "how often; 3"})
HUNGRY = replace(IDEAL, needs={"a_module.that.is_not_there": "pip install 'paper[arm]'", "nor_this": "apt install nor"})
TWICE = replace(IDEAL, needs={"no_such_one": "pip install x", "no_such_two": "pip install x"})
MUTE = replace(IDEAL, capabilities=lambda: 1 / 0)
MUMBLING = replace(IDEAL, capabilities=lambda: {"takes_torque": True})
NO_PLUGIN = 3
"""


@pytest.fixture
def paper(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    names = {
        "paper": "paper_arm_backend:PLUGIN",
        "hungry": "paper_arm_backend:HUNGRY",
        "twice": "paper_arm_backend:TWICE",
        "mute": "paper_arm_backend:MUTE",
        "mumbling": "paper_arm_backend:MUMBLING",
        "no-plugin": "paper_arm_backend:NO_PLUGIN",
        "no-attribute": "paper_arm_backend:NOT_THERE",
        "no-module": "paper_arm_that_is_not_there:PLUGIN",
    }
    offer(
        monkeypatch, tmp_path, distribution="paper-arm", version="2.3", backends=names,
        module="paper_arm_backend", source=GOOD,
    )  # fmt: skip


@pytest.mark.usefixtures("paper")
def test_a_backend_of_another_package_is_found_and_made() -> None:
    assert {"ideal", "mujoco", "paper"} <= set(backend_names())
    description = load_description("lbr-iiwa-7-r800")
    backend = make_backend("paper", BackendRequest(robot="arm", description=description, cycle_ns=1_000_000))
    backend.open(period_ns=1_000_000)
    assert backend.read().position_rad == description.initial_position_rad
    assert installed_backend("paper").origin == "paper-arm 2.3"
    assert installed_backend("paper").problem == ""


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("hungry", "the backend 'hungry' needs more than is installed: pip install 'paper[arm]', apt install nor"),
        ("twice", "the backend 'twice' needs more than is installed: pip install x"),
        (
            "no-plugin",
            (
                "the backend 'no-plugin' (paper_arm_backend:NO_PLUGIN of paper-arm 2.3) is no BackendPlugin of "
                "hil.values.backend, but of type int"
            ),
        ),
        (
            "no-attribute",
            (
                "the backend 'no-attribute' (paper_arm_backend:NOT_THERE of paper-arm 2.3) cannot be loaded: "
                "AttributeError: module 'paper_arm_backend' has no attribute 'NOT_THERE'"
            ),
        ),
        (
            "no-module",
            (
                "the backend 'no-module' (paper_arm_that_is_not_there:PLUGIN of paper-arm 2.3) cannot be loaded: there "
                "is no module 'paper_arm_that_is_not_there', install it"
            ),
        ),
    ],
)
@pytest.mark.usefixtures("paper")
def test_one_that_cannot_be_used_is_refused_in_one_sentence(name: str, sentence: str) -> None:
    with pytest.raises(ConfigurationError) as refused:
        check_backend(name)
    assert str(refused.value) == sentence
    ran = cli("run", "--backend", name, "--duration", 1, "--servo", "off", "--pad", "off")
    assert (ran.code, ran.err.splitlines()[-1]) == (2, f"hil: {sentence}")


def test_a_name_that_two_packages_offer_is_refused_with_both(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    offer(
        monkeypatch, tmp_path, distribution="paper-arm", version="2.3", backends={"ideal": "paper:P", "fine": "paper:P"}
    )
    with pytest.raises(ConfigurationError, match="the backend 'ideal' is offered by ") as refused:
        load_plugin("ideal")
    said = str(refused.value)
    assert "paper-arm 2.3 (paper:P)" in said
    assert "fri-hil 0.1.0 (backends.plugins:IDEAL)" in said
    assert said.endswith(": uninstall all of them but one")
    found = json.loads(cli("backends", "ideal", "--json", "-").out)["ideal"]
    assert set(found["from"].split(" and ")) == {"paper-arm 2.3", "fri-hil 0.1.0"}
    assert found["problem"] == said
    check_backend("mujoco")


def test_a_name_that_nobody_offers_is_refused_with_those_there_are() -> None:
    with pytest.raises(UnknownName, match=r"unknown backend 'nope'; valid: .*ideal, mujoco"):
        check_backend("nope")
    ran = cli("backends", "nope")
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.startswith("hil: unknown backend 'nope'; valid: ")


@pytest.mark.usefixtures("paper")
def test_hil_backends_lists_all_and_says_what_is_wrong_with_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hil.cli.backends._WIDTH_IN_A_FILE", 600)
    ran = cli("backends")
    assert (ran.code, ran.err) == (0, "")
    listed = " ".join(ran.out.replace("│", " ").split())
    for text in (
        "positions, torques, torque sensors, push, drops its drives, replays",
        "paper-arm 2.3",
        "fri-hil 0.1.0",
        "1 ... 5 ms",
        "an arm of \N{REPLACEMENT CHARACTER}[31mpaper[/red]",
        "needs more than is installed: pip install 'paper[arm]'",
        "ZeroDivisionError: division by zero",
        "says what it can do with no Capabilities of hil.values.arm, but type dict",
    ):
        assert text in listed
    assert "\x1b" not in ran.out


@pytest.mark.usefixtures("paper")
def test_hil_backends_as_json_is_what_the_backends_say(tmp_path: Path) -> None:
    file = tmp_path / "backends.json"
    ran = cli("backends", "--json", file)
    assert ran.code == 0
    found = json.loads(file.read_text())
    assert list(found) == list(backend_names())
    assert found["mujoco"]["capabilities"]["takes_torque"] is True
    assert len(found["mujoco"]["capabilities"]["torque_sigma_nm"]) == 7
    assert found["paper"]["options"] == {"fold": "how often; 3"}
    assert found["mute"]["capabilities"] is None
    assert found["mute"]["problem"] == "does not say what it can do: ZeroDivisionError: division by zero"
    assert found["no-module"]["summary"] is None
    assert cli("backends", "ideal", "--json", tmp_path / "no" / "folder.json").code == 2


@pytest.mark.usefixtures("paper")
def test_hil_backends_of_one_shows_its_options() -> None:
    shown = cli("backends", "paper").out
    assert "[robot.options]" in shown
    assert "how often; 3" in shown
    hungry = cli("backends", "hungry")
    assert hungry.code == 0
    assert "pip install 'paper[arm]', apt install nor" in hungry.out
    assert "joints" not in hungry.out


@pytest.mark.usefixtures("paper")
def test_the_test_kit_runs_with_it_by_a_station_file(tmp_path: Path) -> None:
    (tmp_path / "station.toml").write_text("[[robot]]\nbackend = 'paper'\n[robot.servo]\n")
    chosen = configuration([(("station.toml",), {})], folders=[tmp_path])
    controller = VirtualController(chosen.robot)
    with controller.active(), ServoClient("10.0.0.1:30300") as application:
        start = application.read_state().measured_position
        application.move(PTP((start[0] + 0.1, *start[1:])))
        assert controller.measured_position_rad == pytest.approx((start[0] + 0.1, *start[1:]), abs=1e-6)


def test_options_of_a_closer_mark_are_laid_over_those_of_a_farther_one() -> None:
    marks: list[tuple[tuple[()], dict[str, Any]]] = [
        ((), {"options": {"fold": 2}}),
        ((), {"backend": "paper", "options": {"fold": 1, "sheet": "A4"}}),
    ]
    assert configuration(marks, folders=[]).robot.options == {"fold": 2, "sheet": "A4"}


def test_drives_on_a_can_bus_without_their_libraries_name_the_extra_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("backends.registry.find_spec", lambda module: None if module in {"can", "canopen"} else module)
    ran = cli("run", "--backend", "can402", "--duration", 1, "--servo", "off", "--pad", "off")
    sentence = "the backend 'can402' needs more than is installed: pip install 'fri-hil[can]'"
    assert (ran.code, ran.err.splitlines()[-1]) == (2, f"hil: {sentence}")
    assert "needs more than is installed: pip install 'fri-hil[can]'" in cli("backends", "can402").out
