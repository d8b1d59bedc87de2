"""``hil shadow`` beside a running controller: it watches, answers, and never commands."""

import json
from pathlib import Path

from tests.support.processes import finish, hil, own_host, wait_for_line


def test_a_running_controller_is_watched_and_never_commanded(tmp_path: Path) -> None:
    host, status, result = own_host(), tmp_path / "status.json", tmp_path / "shadow.json"
    watched = hil(
        "run", "--backend", "mujoco", "--cycle", 5, "--send-period", 5, "--fri-client", f"{host}:30200",
        "--duration", 60, "--progress", 0, "--status-json", status,
    )  # fmt: skip
    wait_for_line(watched, "MONITORING_WAIT")
    ended = finish(hil("shadow", "--bind", host, "--seconds", 2, "--json", result))
    assert ended.code == 0, ended.err
    assert "waiting for a Cabinet at UDP" in ended.err
    assert finish(watched, interrupt=True).code == 0
    found = json.loads(result.read_text())
    assert found["compared"] > 100
    assert found["differences"]["position"]["A2"]["rms"] < 1.0
    session = json.loads(status.read_text())["robots"]["arm"]["session"]
    entered = {change["to"] for change in session["history"]}
    assert "COMMANDING_WAIT" in entered
    assert "COMMANDING_ACTIVE" not in entered


def test_without_a_cabinet_it_says_so() -> None:
    ended = finish(hil("shadow", "--bind", f"{own_host()}:0", "--connect-s", 0.2))
    assert ended.code == 2
    assert "no message of a Cabinet came to UDP" in ended.err
