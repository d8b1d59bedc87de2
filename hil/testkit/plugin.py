"""The plugin that pytest loads: fixtures, markers, the option. It imports nothing that takes time before it is used."""

from collections import defaultdict
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from hil.testkit._stash import CONTROLLER, OWN_ID, PACKETS, REPETITION
from hil.values.errors import HilError

if TYPE_CHECKING:
    from hil.testkit._configuration import Chosen
    from hil.testkit._network import VirtualNetwork
    from hil.testkit._sweep import Which
    from hil.testkit.controller import VirtualController
    from hil.testkit.process import HilProcess

_VIRTUAL = "hil_controller"
_EVENTS_SHOWN = 30
_MARKER = "each_packet"
_HIL = (
    "hil(station=None, /, robot=..., backend=..., mode=..., fri={...}, servo={...}, limit_s=120, ...): the controller "
    "of hil_controller or hil_process: a station file, or keys of one; robot is the model."
)
_EACH_PACKET = (
    f"{_MARKER}(*actions, direction=None, every=1, only=None, delay_ms=20): run the test again for each packet, with "
    "that packet hit by drop, delay, duplicate or corrupt."
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
    """Make the markers known, and read the option; the suite of all backends shows values where it fails."""
    pytest.register_assert_rewrite("backends.contract")
    for marker in (_HIL, _EACH_PACKET):
        config.addinivalue_line("markers", marker)
    config.pluginmanager.register(_Reports(config), "hil-each-packet")
    if config.getoption("--each-packet") is not None:
        _which(config)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Refuse marks of ``each_packet`` that cannot work, before the first test runs."""
    for item in items:
        if item.get_closest_marker(_MARKER) is None:
            continue
        from hil.testkit._sweep import sweeps_of

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
    if item.get_closest_marker(_MARKER) is None:
        return None
    from hil.testkit._sweep import repeat_for_each_packet, sweeps_of

    repeat_for_each_packet(item, nextitem, sweeps_of(item), _which(item.config))
    return True


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, None, None]:
    """Fail a test that passed although something it arranged for never happened; count its packets."""
    result = yield
    controller = item.stash.get(CONTROLLER, None)
    if controller is not None:
        item.stash[PACKETS] = dict(controller.network.packets)
        if never := controller.never_happened():
            pytest.fail(never, pytrace=False)
    return result


class _Reports:
    """Gives reports of repetitions their own ids, and lets ``--last-failed`` repeat the test they are of."""

    def __init__(self, config: pytest.Config) -> None:
        self._config = config
        self._own_ids: dict[str, set[str]] = defaultdict(set)
        """Repetitions that failed, by the test they are of."""

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_logreport(self, report: pytest.TestReport) -> Generator[None, None, None]:
        nodeid, own_id = report.nodeid, getattr(report, OWN_ID, None)
        # A worker of pytest-xdist may report the tests it was given and no others: there the other end does it.
        if own_id is None or hasattr(self._config, "workerinput"):
            return (yield)
        report.nodeid = own_id
        self._count(nodeid, own_id)
        result = yield
        last_failed = getattr(self._config.pluginmanager.get_plugin("lfplugin"), "lastfailed", None)
        if report.failed and isinstance(last_failed, dict):
            last_failed.pop(own_id, None)
            last_failed[nodeid] = True
        return result

    def _count(self, nodeid: str, own_id: str) -> None:
        """Let pytest reckon with one test more for each further id, so that it shows no progress of 200 %."""
        own_ids, session = self._own_ids[nodeid], self._config.pluginmanager.get_plugin("session")
        if own_ids and own_id not in own_ids and isinstance(session, pytest.Session):
            session.testscollected += 1
        own_ids.add(own_id)


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
    controller = VirtualController(chosen.robot, limit_s=chosen.limit_s, capture=chosen.station.capture)
    with controller.active():
        repetition = stash.get(REPETITION, None)
        if repetition is not None:
            controller.network.arm(repetition.fault)
        stash[CONTROLLER] = controller
        yield controller
        del stash[CONTROLLER]
        if faults := "\n".join(map(str, controller.network.reports())):
            item.add_report_section("teardown", "hil faults", faults)
        item.add_report_section("teardown", "hil controller", "\n".join(controller.told()[-_EVENTS_SHOWN:]))


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


def _which(config: pytest.Config) -> "Which":
    from hil.testkit._sweep import Which

    try:
        return Which.parse(config.getoption("--each-packet"))
    except HilError as error:
        raise pytest.UsageError(str(error)) from None
