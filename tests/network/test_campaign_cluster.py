"""Campaigns on a Dask cluster: a real scheduler, real workers, one of which dies and one of which hangs."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from hil.values.errors import EndpointError
from tests.support.processes import own_host
from tools.campaign import cluster
from tools.campaign.cluster import play_on_cluster
from tools.campaign.plan import load_plan
from tools.campaign.play import play
from transport.udp import free_port

pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning:distributed", "ignore::ResourceWarning:tornado")

WORKERS = 2
CAMPAIGN = """
robot = { backend = "ideal" }
[[application]]
name = "well"
run = "well.py"
[[application]]
name = "dies"
run = "dies.py"
[[application]]
name = "hangs"
run = "hangs.py"
"""
WELL = """
from hil.client.servo import PTP, ServoClient
with ServoClient() as robot:
    robot.move(PTP([0.1, 0.6, 0.0, 0.9, 0.0, 1.3, 0.0]))
"""


def start(*arguments: str) -> "subprocess.Popen[bytes]":
    environment = os.environ | {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1"}
    return subprocess.Popen(
        [sys.executable, "-m", "distributed.cli.dask_" + arguments[0], *arguments[1:]],
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


@pytest.fixture
def scheduler(tmp_path: Path) -> Iterator[str]:
    """Address of a scheduler with two workers."""
    host = own_host()
    address = f"tcp://{host}:{free_port(host)}"
    with ExitStack() as running:
        for command in (
            ("scheduler", "--host", address, "--no-dashboard", "--no-show"),
            ("worker", address, "--host", host, "--nworkers", str(WORKERS), "--nthreads", "1", "--no-dashboard",
             "--local-directory", str(tmp_path)),
        ):  # fmt: skip
            process = running.enter_context(start(*command))
            running.callback(process.terminate)
        yield address


def test_a_cluster_gives_the_same_rows_and_a_worker_that_dies_costs_nobody_else(scheduler: str, tmp_path: Path) -> None:
    for name, text in (("well", WELL), ("dies", "import os\nos._exit(7)\n"), ("hangs", "while True: pass\n")):
        (tmp_path / f"{name}.py").write_text(text)
    file = tmp_path / "campaign.toml"
    file.write_text(CAMPAIGN)
    scenarios = load_plan(file).scenarios
    rows = {
        row["application"]: row for row in play_on_cluster(scenarios, scheduler=scheduler, patience_s=3.0, retries=0)
    }
    here = play(scenarios[0])
    assert {**rows["well"], "wall_s": 0.0} == {**here, "wall_s": 0.0}
    assert here["outcome"] == "passed"
    for name in ("dies", "hangs"):
        assert rows[name]["outcome"] == "worker-died"
        assert name in rows[name]["scenario"]


def test_where_nobody_schedules_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "_CONNECT_S", 1)
    host = own_host()
    with pytest.raises(EndpointError, match=f"no Dask scheduler at tcp://{host}"):
        next(play_on_cluster([], scheduler=f"tcp://{host}:{free_port(host)}", patience_s=1.0, retries=0))
