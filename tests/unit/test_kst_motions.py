"""What KST programs make the arm do, at a controller with a MuJoCo arm in virtual time."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.config.station import parse_station
from hil.kst.paths import Limits, Line, Profile, limits_of
from hil.kst.shaping import CHANGE_RAD_S, STEP_MOST_RAD, Shaping, shaped
from hil.testkit.controller import VirtualController
from hil.values.errors import ConfigurationError
from hil.values.kst import KstSettings, UnprovenLoad
from hil.values.pose import NOWHERE, Pose
from tests.support.kst_virtual import SETTINGS, Visit, visit
from transport.kst import Problem

pytestmark = pytest.mark.hil(backend="mujoco")
START = "jp_0.0_0.0_0.0_-1.5707_0.0_1.5708_0.0_"
AT_START = (0.0, 0.0, 0.0, -1.5707, 0.0, 1.5708, 0.0)


async def at_start(robot: Visit) -> None:
    assert await robot.move("jRelVel_1.0_", START, "doPTPinJS") == "done"


def test_a_joint_motion_arrives_where_it_was_sent(hil_controller: VirtualController) -> None:
    async def program() -> None:
        async with visit() as robot:
            await at_start(robot)
            assert await robot.numbers("getJointsPositions") == pytest.approx(AT_START, abs=3e-4)
            x, y, z, a, b, c = await robot.numbers("Eef_pos")
            assert (x, y, z) == pytest.approx((400.0, 0.0, 654.0), abs=0.3)
            assert (abs(a), b, abs(c)) == pytest.approx((math.pi, 0.0, math.pi), abs=1e-3)

    hil_controller.run_async(program())


def test_a_line_is_straight_and_as_fast_as_asked(hil_controller: VirtualController) -> None:
    async def program() -> None:
        async with visit() as robot:
            await at_start(robot)
            for line in ("jRelVel_100_", f"cArtixanPosition_480_60_600_{math.pi}_0_{math.pi}_"):
                assert await robot.ask(line) == ["done"]
            began_s = hil_controller.now_s
            points = [state.flange_in_base.position_m async for state in robot.watch("doPTPinCS")]
            assert hil_controller.now_s - began_s == pytest.approx(math.dist(points[0], points[-1]) * 10, rel=0.35)
            assert points[-1] == pytest.approx((0.48, 0.06, 0.6), abs=2e-4)
            assert max(_off_line_m(point, points[0], points[-1]) for point in points) < 5e-4

    hil_controller.run_async(program())


def _off_line_m(point: tuple[float, ...], start: tuple[float, ...], end: tuple[float, ...]) -> float:
    way = [b - a for a, b in zip(start, end, strict=True)]
    here = [b - a for a, b in zip(start, point, strict=True)]
    length = math.hypot(*way)
    along = sum(w * h for w, h in zip(way, here, strict=True)) / length
    return math.sqrt(max(0.0, sum(h * h for h in here) - along * along))


def test_relative_lines_go_along_the_base_or_the_tool_and_come_back(hil_controller: VirtualController) -> None:
    async def program() -> None:
        async with visit() as robot:
            await at_start(robot)
            before = await robot.numbers("Eef_pos")
            assert await robot.move("jRelVel_150_", "cArtixanPosition_0_20_30_0_0_0_", "doPTPinCSRelBase") == "done"
            there = await robot.numbers("Eef_pos")
            assert [b - a for a, b in zip(before[:3], there[:3], strict=True)] == pytest.approx([0, 20, 30], abs=0.3)
            # The tool looks down: its z is that of the base, turned round; its y is turned round with it.
            assert await robot.move("cArtixanPosition_0_0_30_0_0_0_", "doPTPinCSRelEEF") == "done"
            after = await robot.numbers("Eef_pos")
            assert [b - a for a, b in zip(there[:3], after[:3], strict=True)] == pytest.approx([0, 0, -30], abs=0.3)
            assert after[4] == pytest.approx(before[4], abs=1e-3)

    hil_controller.run_async(program())


def test_a_circle_keeps_its_radius_and_turns_to_its_end(hil_controller: VirtualController) -> None:
    async def program() -> None:
        async with visit() as robot:
            await at_start(robot)
            turned = math.pi - 0.5
            for line in (
                "jRelVel_100_",
                f"cArtixanPositionCirc1_450_50_654_{math.pi}_0_{math.pi}_",
                f"cArtixanPositionCirc2_500_0_654_{turned}_0_{math.pi}_",
            ):
                assert await robot.ask(line) == ["done"]
            radii, highest = [], 0.0
            async for state in robot.watch("doPTPinCSCircle1_"):
                x, y, _ = state.flange_in_base.position_m
                radii.append(math.hypot(x - 0.45, y))
                highest = max(highest, y)
            assert min(radii) > 0.0492
            assert max(radii) < 0.0508
            assert highest == pytest.approx(0.05, abs=1e-3)
            pose = await robot.numbers("Eef_pos")
            assert pose[:3] == pytest.approx((500.0, 0.0, 654.0), abs=0.3)
            assert pose[3] == pytest.approx(turned, abs=2e-3)

    hil_controller.run_async(program())


def test_points_on_a_line_are_no_circle(hil_controller: VirtualController) -> None:
    async def program() -> None:
        async with visit() as robot:
            await at_start(robot)
            points = ("cArtixanPositionCirc1_450_0_654_0_0_0_", "cArtixanPositionCirc2_450_0_654_0_0_0_")
            assert await robot.move("jRelVel_50_", *points, "doPTPinCSCircle1_") == "nak"
            assert any("no circle has them" in line for line in robot.told)
            assert await robot.ask("blueOn") == ["done"]

    hil_controller.run_async(program())


def test_a_pose_out_of_reach_is_a_nak_and_the_next_motion_is_done(hil_controller: VirtualController) -> None:
    async def program() -> None:
        async with visit() as robot:
            await at_start(robot)
            assert await robot.move("jRelVel_250_", "cArtixanPosition_900_0_954_0_0_0_", "doPTPinCS") == "nak"
            assert await robot.move("jRelVel_1.0_", START, "doPTPinJS") == "done"

    hil_controller.run_async(program())


def test_a_speed_beyond_everything_is_as_fast_as_the_arm_can(hil_controller: VirtualController) -> None:
    async def program() -> None:
        async with visit() as robot:
            await at_start(robot)
            assert await robot.move("jRelVel_1e308_", "cArtixanPosition_0_100_0_0_0_0_", "doPTPinCSRelBase") == "done"
            assert (await robot.numbers("Eef_pos"))[1] == pytest.approx(100.0, abs=0.3)

    hil_controller.run_async(program())


def test_a_tool_moves_the_point_that_is_led(hil_controller: VirtualController) -> None:
    async def program() -> None:
        async with visit() as robot:
            assert await robot.ask("TFtrans_0_0_100_0_0_0") == ["done"]
            await at_start(robot)
            assert (await robot.numbers("Eef_pos"))[:3] == pytest.approx((400.0, 0.0, 554.0), abs=0.4)
            line = f"cArtixanPosition_400_0_554_{math.pi}_0.3_{math.pi}_"
            assert await robot.move("jRelVel_50_", line, "doPTPinCS") == "done"
            assert (await robot.numbers("Eef_pos"))[:3] == pytest.approx((400.0, 0.0, 554.0), abs=0.4)
            assert hil_controller.flange.position_m[0] != pytest.approx(0.4, abs=0.02)

    hil_controller.run_async(program())


def test_joint_servo_follows_with_the_published_shaping(hil_controller: VirtualController) -> None:
    async def program() -> None:
        async with visit() as robot:
            await at_start(robot)
            assert await robot.ask("startDirectServoJoints") == ["done"]
            await robot.pass_s(0.3)
            for step in range(1000):
                set_point = 0.3 * math.sin(step * 0.002 * math.pi)
                assert await robot.ask(f"jp_{set_point}_0_0_-1.5707_0_1.5708_0_\n") == ["done"]
                await robot.pass_s(0.002)
            assert robot.told == []
            await robot.pass_s(0.5)
            assert (await robot.numbers("getJointsPositions"))[0] == pytest.approx(set_point, abs=0.01)
            assert await robot.ask("stopDirectServoJoints") == ["done"]
            await robot.pass_s(0.2)
            assert not robot.session.busy
            assert hil_controller.stands

    hil_controller.run_async(program())


def test_shaping_is_capped_and_soft() -> None:
    assert shaped(2.0) == pytest.approx(STEP_MOST_RAD)
    assert shaped(-1e-3) == pytest.approx(-2.5e-5, rel=0.02)
    assert shaped(0.0) == 0.0


@given(st.lists(st.tuples(st.floats(-3.0, 3.0), st.floats(0.0, 0.02)), min_size=1, max_size=30))
def test_the_way_ahead_keeps_the_published_bounds_and_changes_no_faster_than_an_arm(
    story: list[tuple[float, float]],
) -> None:
    shaping, before = Shaping(), 0.0
    for target, passed_s in story:
        (ahead, *_) = shaping.destination((target,) * 7, (0.0,) * 7, passed_s=passed_s)
        assert abs(ahead) <= max(abs(shaped(target)), abs(before)) + 1e-12
        assert abs(ahead - before) <= CHANGE_RAD_S * passed_s + 1e-12
        assert ahead == before or (ahead - before) * (shaped(target) - before) >= 0.0
        before = ahead


@pytest.mark.parametrize("model", ["lbr-iiwa-14-r820", "lbr-iiwa-7-r800"])
@pytest.mark.parametrize("cycle_ms", [1, 4])
def test_a_set_point_that_jumps_is_reached_without_running_past_it(model: str, cycle_ms: int) -> None:
    """In a stretched pose, three axes at once."""
    config = {"robot": [{"servo": {}, "model": model, "cycle_ms": cycle_ms, "backend": "mujoco"}]}
    made = VirtualController(parse_station(config, where="test").robot[0])

    async def program() -> None:
        async with visit() as robot:
            assert await robot.move("jRelVel_1.0_", "jp_0_1.2_0_-0.3_0_0.3_0_", "doPTPinJS") == "done"
            assert await robot.ask("startDirectServoJoints") == ["done"]
            await robot.pass_s(0.3)
            assert await robot.ask("jp_0.4_1.0_0_-0.3_0_0.3_0.5_") == ["done"]
            farthest = 0.0
            for _ in range(1500 // cycle_ms):
                farthest = max(farthest, (await robot.next_state()).measured_position[0])
            assert robot.told == []
            assert 0.395 < farthest < 0.402

    with made.active():
        made.run_async(program())


@pytest.mark.parametrize(("pose", "frequency_hz"), [("0.3_0_-1.3_0_1.2_0", 2.0), ("0.5_0_-0.9_0_0.6_0", 1.0)])
def test_a_set_point_that_runs_ahead_and_turns_round_is_followed(
    hil_controller: VirtualController, pose: str, frequency_hz: float
) -> None:
    """It meets the arm at 3 or 6 rad/s the other way: the arm brakes as it can, and not past where set-points were."""

    async def program() -> None:
        async with visit() as robot:
            assert await robot.move("jRelVel_1.0_", f"jp_0_{pose}_", "doPTPinJS") == "done"
            assert await robot.ask("startDirectServoJoints") == ["done"]
            await robot.pass_s(0.3)
            farthest = 0.0
            for step in range(750):
                set_point = 0.5 * math.sin(step * 0.002 * frequency_hz * math.tau)
                reply = await robot.numbers(f"jpJP_{set_point:.5f}_{pose}_\n")
                farthest = max(farthest, abs(reply[0]))
                await robot.pass_s(0.002)
            assert robot.told == []
            assert 0.2 < farthest < 0.5

    hil_controller.run_async(program())


def test_cartesian_servo_follows_a_sine_of_the_pose(hil_controller: VirtualController) -> None:
    async def program() -> None:
        async with visit() as robot:
            await at_start(robot)
            x, y, z, a, b, c = await robot.numbers("Eef_pos")
            assert await robot.ask("stDcEEf_") == ["done"]
            await robot.pass_s(0.3)
            lowest = highest = z
            for step in range(1000):
                here = z + 50.0 * math.sin(step * 0.002 * math.pi)
                reply = await robot.numbers(f"DcSeCarEEfP_{x}_{y}_{here}_{a}_{b}_{c}_\n")
                lowest, highest = min(lowest, reply[2]), max(highest, reply[2])
                await robot.pass_s(0.002)
            assert (lowest, highest) == pytest.approx((z - 50.0, z + 50.0), abs=3.0)
            assert await robot.ask("stopDirectServoJoints") == ["done"]
            await robot.pass_s(0.2)
            assert await robot.move("jRelVel_1.0_", START, "doPTPinJS") == "done"

    hil_controller.run_async(program())


def test_a_set_point_too_far_away_ends_the_mode_and_says_so(hil_controller: VirtualController) -> None:
    async def program() -> None:
        async with visit() as robot:
            await at_start(robot)
            assert await robot.ask("stDcEEf_") == ["done"]
            await robot.pass_s(0.3)
            assert await robot.ask(f"DcSeCarW_400_300_654_{math.pi}_0_{math.pi}_") == ["done"]
            await robot.pass_s(0.5)
            assert any("directServo: Target Outside accepted Delta" in line for line in robot.told)
            assert await robot.ask("DcSeCarJP_400_0_654_0_0_0_") != ["nak"]
            assert await robot.ask("stopDirectServoJoints") == ["done"]
            assert await robot.move("jRelVel_1.0_", START, "doPTPinJS") == "done"

    hil_controller.run_async(program())


@pytest.mark.parametrize("speed_mm_s", [100.0, 150.0, 5000.0])
def test_every_length_has_a_profile_and_one_of_twenty_millimetres_too(speed_mm_s: float) -> None:
    for step in range(-100, 101):
        way = Line(Pose(0.0, 0.0, 0.0), Pose(0.0, 0.0, 0.02 * (1.0 + step * 1e-16)))
        limits = limits_of(way, speed_mm_s=speed_mm_s, tcp_in_flange=NOWHERE, in_t1=False)
        assert limits is not None
        assert Profile(limits).duration_s == pytest.approx(0.4, abs=1e-3)


def test_a_path_that_would_take_for_ever_is_refused_in_words() -> None:
    with pytest.raises(ConfigurationError, match="takes 1e\\+300 s at its speed"):
        Profile(Limits(1e-310, 20.0, 200.0))


def test_velocities_that_come_while_the_program_is_paused_are_not_made_up_for(
    hil_controller: VirtualController,
) -> None:
    async def program() -> None:
        async with visit() as robot:
            await at_start(robot)
            assert await robot.ask("stVelDcJoint_") == ["done"]
            hil_controller.after(0.5, hil_controller.operator.pause)
            hil_controller.after(2.5, hil_controller.operator.start)
            fastest_rad_s = 0.0
            for _ in range(40):
                assert await robot.ask("velJDC_0.03_0_0_0_0_0_0_") == ["done"]
                for _ in range(100):
                    await robot.next_state()
                    fastest_rad_s = max(fastest_rad_s, abs(hil_controller.measured_velocity_rad_s[0]))
            assert hil_controller.measured_velocity_rad_s[0] == pytest.approx(0.03, abs=0.01)
            assert fastest_rad_s < 0.06
            assert await robot.ask("stopDirectServoJoints") == ["done"]

    hil_controller.run_async(program())


def test_velocities_are_integrated_and_silence_stops_the_arm(hil_controller: VirtualController) -> None:
    async def program() -> None:
        async with visit() as robot:
            await at_start(robot)
            assert await robot.ask("stVelDcJoint_") == ["done"]
            await robot.pass_s(0.3)
            for _ in range(50):
                assert await robot.ask("velJDC_0.2_0_0_0_0_0_0_") == ["done"]
                await robot.pass_s(0.01)
            moved = (await robot.numbers("getJointsPositions"))[0]
            assert moved == pytest.approx(0.1, abs=0.02)
            await robot.pass_s(2.0)
            assert any("no velocity came for 1000 ms: the arm stops" in line for line in robot.told)
            assert hil_controller.measured_velocity_rad_s == pytest.approx((0.0,) * 7, abs=1e-3)
            assert await robot.ask("velJDCJP_-0.2_0_0_0_0_0_0_") != ["nak"]
            await robot.pass_s(0.5)
            assert hil_controller.measured_velocity_rad_s[0] == pytest.approx(-0.2, abs=0.02)

    hil_controller.run_async(program())


def test_a_conditional_motion_is_interrupted_by_a_torque(hil_controller: VirtualController) -> None:
    async def program() -> None:
        async with visit() as robot:
            await at_start(robot)
            move = ("jRelVel_0.3_", "jp_1.0_0_0_-1.5707_0_1.5708_0_")
            assert await robot.move(*move, "doPTP!inJS_0_-300_300") == "done"
            assert await robot.move("jp_-1.0_0_0_-1.5707_0_1.5708_0_", "doPTP!inJS_1_500_600") == "interrupted"
            assert any("interrupted: A2 shows" in line for line in robot.told)
            line = f"cArtixanPosition_400_100_654_{math.pi}_0_{math.pi}_"
            assert await robot.move("jRelVel_1.0_", START, "doPTPinJS") == "done"
            assert await robot.move("jRelVel_50_", line, "doPTP!inCS_1_500_600") == "interrupted"
            assert await robot.move(line, "doPTP!inCS_1_-600_600") == "done"

    hil_controller.run_async(program())


def test_a_client_that_leaves_in_mid_motion_brakes_the_arm(hil_controller: VirtualController) -> None:
    async def program() -> None:
        async with visit() as robot:
            await at_start(robot)
            for line in ("jRelVel_0.2_", "jp_1.5_0_0_-1.5707_0_1.5708_0_", "doPTPinJS"):
                assert await robot.ask(line) == ["done"]
            await robot.pass_s(1.0)
        async with visit() as robot:
            await robot.pass_s(1.0)
            assert hil_controller.stands
            assert 0.05 < (await robot.numbers("getJointsPositions"))[0] < 1.0
            assert await robot.move("jRelVel_0.5_", START, "doPTPinJS") == "done"

    hil_controller.run_async(program())


@pytest.mark.hil(mode="T1", enabled=True)
def test_in_t1_a_line_is_never_faster_than_the_monitor_allows(hil_controller: VirtualController) -> None:
    async def program() -> None:
        async with visit() as robot:
            await at_start(robot)
            line = f"cArtixanPosition_400_300_654_{math.pi}_0_{math.pi}_"
            for asked in ("jRelVel_1000_", line):
                assert await robot.ask(asked) == ["done"]
            fastest = 0.0
            async for state in robot.watch("doPTPinCS"):
                fastest = max(fastest, state.flange_speed_mm_s)
            assert 200.0 < fastest <= 250.0
            assert hil_controller.last_stop is None or "T1" not in hil_controller.last_stop.reason

    hil_controller.run_async(program())


@pytest.mark.hil(mode="T1")
def test_in_t1_a_motion_waits_for_the_enabling_switch_and_says_so(hil_controller: VirtualController) -> None:
    async def program() -> None:
        async with visit() as robot:
            for line in ("jRelVel_1.0_", START, "doPTPinJS"):
                assert await robot.ask(line) == ["done"]
            await robot.pass_s(1.0)
            assert robot.session.busy
            assert any("waits for the operator: T1: the enabling switch is not held" in line for line in robot.told)
            hil_controller.operator.enable()
            hil_controller.operator.start()
            await robot.pass_s(8.0)
            assert await robot.ask("") == ["done"]

    hil_controller.run_async(program())


def test_an_emergency_stop_is_a_nak(hil_controller: VirtualController) -> None:
    async def program() -> None:
        async with visit() as robot:
            await at_start(robot)
            for line in ("jRelVel_0.2_", "jp_1.5_0_0_-1.5707_0_1.5708_0_", "doPTPinJS"):
                assert await robot.ask(line) == ["done"]
            hil_controller.after(0.5, hil_controller.operator.emergency_stop)
            await robot.pass_s(2.0)
            assert not robot.session.busy
            assert any("the motion failed: " in line and "emergency stop" in line for line in robot.told)
            assert await robot.ask("") == ["nak"]
            assert await robot.move("doPTPinJS") == "nak"
            assert not any("waits" in line for line in robot.told)

    hil_controller.run_async(program())


def test_while_somebody_else_commands_queries_are_served_and_motions_refused(hil_controller: VirtualController) -> None:
    async def program() -> None:
        async with visit() as other:
            await at_start(other)
            async with visit() as robot:
                assert any("commanded by somebody else" in line for line in robot.told)
                assert await robot.numbers("getJointsPositions") == pytest.approx(AT_START, abs=3e-4)
                assert await robot.move("jRelVel_0.5_", START, "doPTPinJS") == "nak"
                await other.robot.close()
                await robot.pass_s(0.2)
                assert await robot.move("jRelVel_0.5_", START, "doPTPinJS") == "done"

    hil_controller.run_async(program())


def test_limits_are_those_of_the_robot(hil_controller: VirtualController) -> None:
    async def program() -> None:
        settings = KstSettings((-0.5,) * 7, (0.5,) * 7)
        async with visit(settings) as robot:
            assert await robot.ask("jp_0_0_0_0.6_0_0_0_") == ["nak"]
            assert robot.session.log.refused[Problem.OUT_OF_RANGE] == 1

    hil_controller.run_async(program())
    assert SETTINGS.watchdog_ms == 1000


IMPEDANCE = "startSmartImpedanceJoints_1.0_0.0_0.0_0.0_900_80_50_"


async def bent(robot: Visit) -> None:
    """Go to a pose that is far from singularities."""
    assert await robot.move("jRelVel_1.0_", "jp_0_0.3_0_-1.3_0_1.2_0_", "doPTPinJS") == "done"


async def stop_impedance(robot: Visit) -> None:
    """Stop it, and take both acknowledgements."""
    assert await robot.ask("stopDirectServoJoints", replies=2) == ["done", "done"]


@pytest.mark.hil(load={"mass_kg": 1.0})
def test_impedance_follows_set_points_softly_with_the_load_that_was_told(hil_controller: VirtualController) -> None:
    async def program() -> None:
        async with visit() as robot:
            await bent(robot)
            assert await robot.ask(IMPEDANCE) == ["done"]
            await robot.pass_s(0.3)
            for step in range(500):
                assert len(await robot.numbers(f"jpMT_{0.0004 * step}_0.3_0_-1.3_0_1.2_0_\n")) == 7
                await robot.pass_s(0.004)
            await robot.pass_s(1.0)
            assert (await robot.numbers("getJointsPositions"))[0] == pytest.approx(0.2, abs=0.03)
            before = hil_controller.flange.position_m
            hil_controller.operator.push((0.0, 0.0, -18.0), duration_s=3.0)
            await robot.pass_s(2.0)
            # 18 N on a spring of 900 N/m.
            assert before[2] - hil_controller.flange.position_m[2] == pytest.approx(0.02, abs=0.006)
            await robot.pass_s(2.0)
            assert robot.told == []
            await stop_impedance(robot)
            await bent(robot)

    hil_controller.run_async(program())


def test_a_load_that_is_not_there_is_said_and_the_true_one_taken(hil_controller: VirtualController) -> None:
    async def program() -> None:
        async with visit() as robot:
            await bent(robot)
            for _ in range(2):
                assert await robot.ask(IMPEDANCE) == ["done"]
                await robot.pass_s(0.5)
                assert any("a Cabinet may refuse this impedance mode: the load of 1 kg" in line for line in robot.told)
                assert any("Taken instead: 0 kg" in line for line in robot.told)
                assert robot.session.busy
                await stop_impedance(robot)
            await bent(robot)

    hil_controller.run_async(program())


def test_a_load_that_is_not_there_ends_the_mode_where_it_is_to_be_refused(hil_controller: VirtualController) -> None:
    async def program() -> None:
        async with visit(replace(SETTINGS, unproven_load=UnprovenLoad.REFUSE)) as robot:
            await bent(robot)
            assert await robot.ask(IMPEDANCE, replies=2) == ["done", "done"]
            assert any("the load of 1 kg that was told does not explain the torques" in line for line in robot.told)
            assert not robot.session.busy
            assert await robot.ask("stopDirectServoJoints") == ["done"]

    hil_controller.run_async(program())


@pytest.mark.parametrize("numbers", ["1.0_0_0_0_9000_80_50", "-1.0_0_0_0_900_80_50", "1.0_0_0_0_900_80_-50"])
def test_impedance_beyond_its_ranges_ends_with_a_sentence(hil_controller: VirtualController, numbers: str) -> None:
    async def program() -> None:
        async with visit() as robot:
            await bent(robot)
            assert await robot.ask(f"startSmartImpedneceJoints_{numbers}_", replies=2) == ["done", "done"]
            assert any("is outside its range" in line for line in robot.told)

    hil_controller.run_async(program())


@pytest.mark.hil(backend="ideal")
def test_an_arm_without_torques_has_no_impedance_and_says_so(hil_controller: VirtualController) -> None:
    async def program() -> None:
        async with visit() as robot:
            await bent(robot)
            assert await robot.ask(IMPEDANCE, replies=2) == ["done", "done"]
            assert any("set-points move nothing from now on" in line for line in robot.told)

    hil_controller.run_async(program())
