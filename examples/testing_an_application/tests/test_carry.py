"""The servo application, in virtual time: seconds of carrying take a moment."""

import pytest
from cell.carry import PLACE, Carrier, OperatorAway

from hil.client.servo import ServoClient, SessionEnded, SessionRefused
from hil.testkit import Direction, HalfOpen, Jitter, Loss, VirtualController

pytestmark = pytest.mark.hil(fri=None)
ANYWHERE = "192.168.0.10:30300"
"""In virtual time a controller is at any address, with the right port."""


def off_rad(position: tuple[float, ...], point: tuple[float, ...]) -> float:
    return max(abs(one - other) for one, other in zip(position, point, strict=True))


def test_it_carries(hil_controller: VirtualController) -> None:
    report = Carrier(ANYWHERE).carry(parts=2)
    assert (report.carried, report.interruptions) == (2, 0)
    assert off_rad(hil_controller.measured_position_rad, PLACE) < 1e-4
    assert hil_controller.last_stop is None


def test_after_an_emergency_stop_in_mid_motion_it_goes_on_with_the_same_part(hil_controller: VirtualController) -> None:
    operator = hil_controller.operator
    hil_controller.when(lambda: hil_controller.flange_speed_mm_s > 100.0, operator.emergency_stop)
    hil_controller.after(5.0, operator.reset)
    hil_controller.after(6.0, operator.start)
    report = Carrier(ANYWHERE).carry(parts=1)
    assert (report.carried, report.interruptions) == (1, 1)
    assert hil_controller.now_s > 6.0
    stop = hil_controller.last_stop
    assert stop is not None
    assert stop.reason == "the emergency stop was pressed"


def test_an_operator_who_does_not_come_back_is_told_with_his_reason(hil_controller: VirtualController) -> None:
    hil_controller.after(0.5, hil_controller.operator.emergency_stop)
    with pytest.raises(OperatorAway, match="emergency stop"):
        Carrier(ANYWHERE, patience_s=10.0).carry(parts=1)
    assert 10.0 < hil_controller.now_s < 11.0
    assert hil_controller.stands


@pytest.mark.hil(mode="T1")
def test_in_t1_it_waits_for_the_enabling_switch_and_keeps_the_speed_limit(hil_controller: VirtualController) -> None:
    hil_controller.after(1.0, hil_controller.operator.enable)
    hil_controller.after(1.5, hil_controller.operator.start)
    Carrier(ANYWHERE, speed=1.0).carry(parts=1)
    assert hil_controller.now_s > 1.5
    assert 200.0 < hil_controller.report()["max_flange_speed_mm_s"] < 250.0


def test_a_second_carrier_is_refused_and_the_first_is_not_disturbed(hil_controller: VirtualController) -> None:
    with ServoClient(ANYWHERE, name="the first") as first:
        with pytest.raises(SessionRefused, match="the first"):
            Carrier(ANYWHERE).carry(parts=1)
        assert first.session.running


@pytest.mark.parametrize("seed", range(3))
def test_a_bad_network_costs_time_and_nothing_else(hil_controller: VirtualController, seed: int) -> None:
    hil_controller.network.arm(Loss(0.05), Jitter(3_000_000), seed=seed)
    report = Carrier(ANYWHERE).carry(parts=1)
    assert (report.carried, report.interruptions) == (1, 0)


def test_a_link_that_dies_one_way_ends_the_motion_and_brakes_the_arm(hil_controller: VirtualController) -> None:
    hil_controller.network.arm(HalfOpen(Direction.TO_CONTROLLER, from_ns=300_000_000))
    with pytest.raises(SessionEnded):
        Carrier(ANYWHERE).carry(parts=1)
    hil_controller.run_until(lambda: hil_controller.stands, at_most_s=0.5)
    assert "silent" in str(hil_controller.last_stop)


@pytest.mark.each_packet("drop", "duplicate", "corrupt", every=10)
@pytest.mark.each_packet("delay", every=10, delay_ms=30)
def test_it_survives_whatever_happens_to_a_single_packet(hil_controller: VirtualController) -> None:
    start = hil_controller.measured_position_rad
    near = (start[0] + 0.02, *start[1:])
    report = Carrier(ANYWHERE, pick=near, place=start).carry(parts=1)
    assert (report.carried, report.interruptions) == (1, 0)
    assert off_rad(hil_controller.measured_position_rad, start) < 1e-4
