"""What a virtual controller records replays to the byte, whatever the network and the operator did to it."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from hil.client.fri import FriClient, FriHandler, Release
from hil.client.pad import PadRefused
from hil.client.servo import PTP, ServoClient, SmartServo
from hil.config.station import RobotConfig
from hil.replay import replay_file
from hil.testkit import Corrupt, Duplicate, Jitter, Loss, Reorder, VirtualController

NEAR = (0.0, math.radians(30.0), 0.0, math.radians(45.0), 0.0, math.radians(90.0), 0.0)
FAULTS = Loss(0.03), Jitter(2_000_000), Duplicate(0.03), Reorder(0.03), Corrupt(0.01)


@contextmanager
def recorded(file: Path, **robot: Any) -> Iterator[VirtualController]:
    controller = VirtualController(RobotConfig.model_validate({"backend": "ideal", **robot}), capture=file)
    with controller.active():
        yield controller


@pytest.mark.parametrize("seed", range(3))
def test_a_servo_program_in_a_bad_network(tmp_path: Path, seed: int) -> None:
    file = tmp_path / "run.pcapng"
    with recorded(file, servo={}) as controller:
        controller.network.arm(*FAULTS, seed=seed)
        controller.after(0.4, controller.operator.pause)
        controller.after(0.7, controller.operator.start)
        with ServoClient() as robot:
            robot.move(PTP(NEAR))
            motion = SmartServo()
            robot.move_async(motion)
            motion.get_runtime().set_destination((*NEAR[:6], 0.1))
            controller.run(1.0)
        controller.shut_down()
        controller.run(0.5)
    result = replay_file(file)
    assert result.verdict.startswith("identical byte for byte"), result.verdict
    assert result.complete
    assert result.inputs > 20


def test_an_fri_program_in_a_bad_network(tmp_path: Path) -> None:
    file = tmp_path / "run.pcapng"
    robot = {
        "backend": "mujoco",
        "mode": "T1",
        "fri": {"release": "2.7", "send_period_ms": 5, "bind": "127.0.0.2:30200"},
    }
    with recorded(file, **robot) as controller:
        controller.network.arm(Jitter(1_000_000), Corrupt(0.02))
        with pytest.raises(PadRefused):
            controller.operator.start()
        controller.operator.enable()
        controller.after(0.5, controller.operator.start)
        controller.after(1.5, lambda: controller.operator.push((10.0, 0.0, 0.0), duration_s=0.1))
        with FriClient(FriHandler(), release=Release.V2_7) as client:
            client.run(duration_s=2.0)
    result = replay_file(file)
    assert result.verdict.startswith("identical byte for byte"), result.verdict
    assert result.compared > 390


def test_a_capture_of_nobody_is_whole(tmp_path: Path) -> None:
    file = tmp_path / "run.pcapng"
    with recorded(file, servo={}) as controller:
        controller.run(0.01)
    result = replay_file(file)
    assert result.complete
    assert result.cycles > 9
