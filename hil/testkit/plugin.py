"""The plugin that pytest loads: fixtures, markers, the option. It imports nothing that takes time before it is used."""

from collections.abc import Generator, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from hil.testkit._sweep import (
    ITEM_ATTRIBUTE,
    MARKER,
    PACKETS,
    REPETITION,
    Which,
    repeat_for_each_packet,
    sweeps_of,
)
from hil.values.errors import HilError

if TYPE_CHECKING:
    from hil.testkit._configuration import Chosen
    from hil.testkit._network import VirtualNetwork
    from hil.testkit.controller import VirtualController
    from hil.testkit.process import HilProcess

_VIRTUAL = "hil_controller"
_CONTROLLER = pytest.StashKey["VirtualController"]()
_MARKERS = (
    "hil(station=None, /, robot=..., backend=..., mode=..., fri={...}, servo={...}, limit_s=600, ...): the controller "
    "of hil_controller or hil_process: a station file, or keys of one; robot is the model.",
    f"{MARKER}(*actions, direction=None, every=1, only=None, delay_ms=20): run the test again for each packet, with "
    "that packet hit by drop, delay, duplicate or corrupt.",
)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add ``--each-packet``."""
    parser.getgroup("hil").addoption(
        "--each-packet",
        metavar="[ACTION:][DIRECTION:]INDEX|none",
        default=None,
        help="Of the repetitions of @pytest.mark.each_packet only those of one packet; none: no repetition at all.",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Make the markers known, and read the option."""
    for marker in _MARKERS:
        config.addinivalue_line("markers", marker)
    _which(config)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Refuse marks of ``each_packet`` that cannot work, before the first test runs."""
    for item in items:
        if item.get_closest_marker(MARKER) is None:
            continue
        try:
            sweeps_of(item)
        except HilError as error:
            raise pytest.UsageError(f"{item.nodeid}: {error}") from None
        if _VIRTUAL not in getattr(item, "fixturenames", ()):
            raise pytest.UsageError(
                f"{item.nodeid}: each_packet counts packets in virtual time, so the test needs the fixture {_VIRTUAL}, "
                "or hil_network"
            )


def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool | None:
    """Run a test of ``each_packet`` again and again."""
    if item.get_closest_marker(MARKER) is None:
        return None
    repeat_for_each_packet(item, nextitem, sweeps_of(item), _which(item.config))
    return True


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, None, None]:
    """Fail a test that passed although something it arranged for never happened; count its packets."""
    result = yield
    controller = item.stash.get(_CONTROLLER, None)
    if controller is not None:
        item.stash[PACKETS] = dict(controller.network.packets)
        try:
            controller.require_happened()
        except HilError as error:
            pytest.fail(str(error), pytrace=False)
    return result


@pytest.hookimpl(trylast=True)
def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Let ``--last-failed`` repeat the test of a repetition that failed."""
    item = getattr(report, ITEM_ATTRIBUTE, None)
    if item is not None and report.failed and _last_failed is not None:
        _last_failed.pop(report.nodeid, None)
        _last_failed[item] = True


_last_failed: dict[str, bool] | None = None


def pytest_sessionstart(session: pytest.Session) -> None:
    """Find what ``--last-failed`` remembers."""
    global _last_failed  # noqa: PLW0603  # pytest_runtest_logreport is handed no session
    plugin = session.config.pluginmanager.get_plugin("lfplugin")
    found = getattr(plugin, "lastfailed", None)
    _last_failed = found if isinstance(found, dict) else None


@pytest.fixture
def hil_controller(request: pytest.FixtureRequest) -> Iterator["VirtualController"]:
    """A controller in virtual time; clients of ``hil.client`` opened in the test reach it, and ``time`` is virtual.

    ``@pytest.mark.hil(...)`` configures it. At the end, a fault that never fired and an action that never came fail the
    test.
    """
    if "hil_process" in request.fixturenames:
        raise pytest.UsageError("hil_controller and hil_process: one test has a virtual controller or a process")
    from hil.testkit.controller import VirtualController

    chosen = _chosen(request)
    item, stash = request.node, request.node.stash
    controller = VirtualController(chosen.robot, limit_s=chosen.limit_s)
    with controller.active():
        repetition = stash.get(REPETITION, None)
        if repetition is not None:
            controller.network.arm(repetition.fault)
        stash[_CONTROLLER] = controller
        yield controller
        del stash[_CONTROLLER]
        for fault in controller.network.reports():
            item.add_report_section("teardown", "hil faults", f"{fault}\n")
        item.add_report_section("teardown", "hil controller", "\n".join(controller.told()[-30:]))


@pytest.fixture
def hil_network(hil_controller: "VirtualController") -> "VirtualNetwork[Any]":
    """The network between the applications and ``hil_controller``: ``hil_network.arm(Loss(0.02), Jitter(...))``."""
    return hil_controller.network


@pytest.fixture
def hil_process(request: pytest.FixtureRequest) -> Iterator["HilProcess"]:
    """A controller process, ``hil run``, on a loopback address of its own; ready when the test begins."""
    from hil.testkit.process import controller_process

    with controller_process(_chosen(request).station) as process:
        yield process
        process.close()
        request.node.add_report_section("teardown", "hil run", process.output)


def _chosen(request: pytest.FixtureRequest) -> "Chosen":
    from hil.testkit._configuration import configuration

    marks = [(mark.args, mark.kwargs) for mark in request.node.iter_markers("hil")]
    folders: list[Path] = [request.path.parent, request.config.rootpath, request.config.invocation_params.dir]
    return configuration(marks, folders=folders)


def _which(config: pytest.Config) -> Which:
    try:
        return Which.parse(config.getoption("--each-packet"))
    except HilError as error:
        raise pytest.UsageError(str(error)) from None
