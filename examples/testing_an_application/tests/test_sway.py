"""The FRI client, in virtual time."""

import pytest
from cell.sway import AXIS, Sway, run

from hil.client.fri import Quality, SessionState
from hil.client.servo import CartesianImpedanceControlMode, ServoClient, SmartServo
from hil.testkit import Jitter, Loss, VirtualController

pytestmark = pytest.mark.hil(fri={"release": "2.5", "send_period_ms": 5})


def commanding(controller: VirtualController) -> bool:
    return controller.session_state is SessionState.COMMANDING_ACTIVE


def test_the_program_sways(hil_controller: VirtualController) -> None:
    seen: list[float] = []
    start = hil_controller.measured_position_rad[AXIS]
    hil_controller.after(2.0, lambda: seen.append(hil_controller.measured_position_rad[AXIS]))
    assert run(Sway(), seconds=4.0) == 800
    assert hil_controller.quality is Quality.EXCELLENT
    assert abs(seen[0] - start) > 0.02


def test_the_handler_alone_begins_anew_after_an_emergency_stop(hil_controller: VirtualController) -> None:
    sway = Sway()
    hil_controller.attach_fri(sway)
    hil_controller.run_until(lambda: commanding(hil_controller))
    hil_controller.run(1.0)
    hil_controller.operator.emergency_stop()
    hil_controller.run(1.0)
    assert not commanding(hil_controller)
    assert hil_controller.stands
    hil_controller.operator.reset()
    hil_controller.operator.start()
    hil_controller.run_until(lambda: sway.motions == 2)


@pytest.mark.hil(mode="T1", enabled=True)
@pytest.mark.parametrize(("amplitude_rad", "stopped"), [(0.05, False), (0.5, True)])
def test_t1_lets_a_slow_sine_pass_and_stops_a_fast_one(
    hil_controller: VirtualController, amplitude_rad: float, stopped: bool
) -> None:
    hil_controller.attach_fri(Sway(amplitude_rad=amplitude_rad))
    hil_controller.run(6.0)
    assert bool(hil_controller.stops) is stopped
    if stopped:
        assert "T1" in hil_controller.stops[0].reason


def test_loss_and_jitter_do_not_stop_it(hil_controller: VirtualController) -> None:
    hil_controller.network.arm(Loss(0.01), Jitter(1_000_000), seed=1)
    sway = Sway()
    run(sway, seconds=6.0)
    assert sway.motions == 1
    assert not hil_controller.stops


@pytest.mark.each_packet("drop", every=40)
def test_it_goes_on_whichever_packet_is_lost(hil_controller: VirtualController) -> None:
    sway = Sway()
    run(sway, seconds=1.5)
    assert sway.motions >= 1
    assert commanding(hil_controller)


@pytest.mark.hil(backend="mujoco", fri=None)
def test_an_arm_that_is_pushed_yields_and_comes_back(hil_controller: VirtualController) -> None:
    with ServoClient() as robot:
        assert robot.validate_for_impedance_mode()
        motion = SmartServo().set_mode(CartesianImpedanceControlMode())
        robot.move_async(motion)
        motion.get_runtime()
        before = hil_controller.flange.z_m
        hil_controller.operator.push((0.0, 0.0, -40.0), duration_s=1.0)
        hil_controller.run(0.9)
        assert 0.005 < before - hil_controller.flange.z_m < 0.1
        hil_controller.run(1.5)
        assert abs(before - hil_controller.flange.z_m) < 0.002
