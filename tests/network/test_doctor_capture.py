"""A client that falls silent: hil run says whose fault it was, and hil doctor capture says the same afterwards."""

import json
from pathlib import Path

from tests.support.cli import cli
from tests.support.processes import finish, hil, own_host, probe


def test_the_verdict_of_a_run_is_that_of_its_recording(tmp_path: Path) -> None:
    host, status, capture = own_host(), tmp_path / "status.json", tmp_path / "run.pcapng"
    client = probe(
        "--release", "1.15", "--bind", host, "--port", 30200, "--seconds", 8, "--silent-after", 300, "--silent-for", 30
    )
    controller = hil(
        "run", "--fri-client", f"{host}:30200", "--send-period", 5, "--duration", 2.5,
        "--status-json", status, "--capture", capture,
    )  # fmt: skip
    ended = finish(controller)
    finish(client)
    assert ended.code == 0, ended.err
    robot = next(iter(json.loads(status.read_text())["robots"].values()))
    found = [one for one in robot["findings"] if one["severity"] in {"fault", "warning"}]
    assert found, robot["findings"]
    assert set(robot["answer_path_us"]) == {"send_lateness", "peer_and_wire", "wait", "use_lateness"}
    sentence = found[0]["sentence"]
    assert sentence in ended.err
    assert sentence in ended.out
    offline = cli("doctor", "capture", capture, "--json", "-")
    assert offline.code == 1
    assert json.loads(offline.out)["verdict"] == sentence
