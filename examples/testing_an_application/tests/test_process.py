"""Both programs against a controller process: sockets, threads and real time, where virtual time has none."""

import pytest
from cell.carry import Carrier
from cell.sway import Sway, run

from hil.testkit import HilProcess


@pytest.mark.hil(fri={"release": "2.5", "send_period_ms": 5})
def test_the_programs_run_against_a_controller_process(hil_process: HilProcess) -> None:
    assert run(Sway(), seconds=0.5, bind_host=hil_process.fri_client_host, port=hil_process.fri_client_port) > 50
    assert Carrier(hil_process.servo_address, speed=1.0).carry(parts=1).carried == 1
    hil_process.operator.emergency_stop()
    assert hil_process.pad()["program"] == "EMERGENCY_STOP"
    status = hil_process.stop()
    assert status["servo"]["motions_begun"] == 2
    assert status["packets"]["accepted"] > 50
