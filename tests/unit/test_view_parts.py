"""Small parts of the view: the token, where robots are found, what a jog key does to a pose, what a drag pushes."""

import math
from types import SimpleNamespace

import pytest

from hil.values.errors import ConfigurationError, EndpointError
from hil.values.pose import NOWHERE, Pose
from tools.view.browser.push import MOST_N, STIFFNESS_N_M, push_force
from tools.view.jog import JogKey, Space, moved
from tools.view.sources import Source, from_addresses
from tools.view.token import checked_token, new_token, same_token
from tools.view.watch import Watch

START = Pose.from_abc_deg((0.5, 0.1, 0.7), 90.0, 0.0, 0.0)
"""Its x is the base's y."""


def test_tokens_differ_and_are_told_apart() -> None:
    token = new_token()
    assert token != new_token()
    assert same_token(f" {token}\n", token)
    assert not same_token(token[:-1], token)
    assert not same_token("", token)
    assert not same_token("ü" * 20, token)
    assert checked_token(token) == token


@pytest.mark.parametrize("text", ["", "short", "has a blank in it", "with/slash/in/it", "ümläutümläut"])
def test_a_token_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(ConfigurationError, match="letters and digits"):
        checked_token(text)


def test_robots_are_found_by_address() -> None:
    assert from_addresses(["127.0.0.1", "127.0.0.2:30301"]).robots == (Source("127.0.0.1"), Source("127.0.0.2:30301"))


def test_a_robot_that_is_not_there_is_told_at_once() -> None:
    watch = Watch(from_addresses(["127.0.0.1:9"]), connect_timeout_s=0.2)
    with pytest.raises(EndpointError, match=r"127\.0\.0\.1:9"):
        watch.open()
    watch.close()


@pytest.mark.parametrize(
    ("key", "by", "position_m"),
    [
        (JogKey(Space.TOOL, 0, 1), 0.1, (0.5, 0.2, 0.7)),
        (JogKey(Space.TOOL, 1, 1), 0.1, (0.4, 0.1, 0.7)),
        (JogKey(Space.BASE, 0, 1), 0.1, (0.6, 0.1, 0.7)),
        (JogKey(Space.BASE, 2, 1), -0.1, (0.5, 0.1, 0.6)),
    ],
)
def test_a_direction_is_that_of_the_frame_or_of_the_base(
    key: JogKey, by: float, position_m: tuple[float, float, float]
) -> None:
    after = moved(START, key, by)
    assert after.position_m == pytest.approx(position_m)
    assert START.angle_rad(after) == pytest.approx(0.0, abs=1e-7)


@pytest.mark.parametrize("space", [Space.TOOL, Space.BASE])
@pytest.mark.parametrize("number", [3, 4, 5])
def test_a_turn_leaves_the_frame_where_it_is(space: Space, number: int) -> None:
    after = moved(START, JogKey(space, number, 1), math.radians(30.0))
    assert after.position_m == pytest.approx(START.position_m)
    assert math.degrees(START.angle_rad(after)) == pytest.approx(30.0)


def test_a_turn_is_about_the_frame_or_about_the_base() -> None:
    about_x = Pose.from_abc_deg((0.0, 0.0, 0.0), 0.0, 0.0, 30.0)
    in_tool = moved(START, JogKey(Space.TOOL, 5, 1), math.radians(30.0))
    in_base = moved(START, JogKey(Space.BASE, 5, 1), math.radians(30.0))
    assert in_tool.angle_rad(START @ about_x) == pytest.approx(0.0, abs=1e-7)
    assert in_base.angle_rad(about_x @ START) == pytest.approx(0.0, abs=1e-7)


def test_a_key_says_what_it_is() -> None:
    assert [str(JogKey(Space.AXIS, 3, 1)), str(JogKey(Space.TOOL, 5, -1))] == ["A4+", "C-"]


def test_a_drag_is_a_spring_in_the_axes_of_the_robot_base() -> None:
    drag = SimpleNamespace(start_position=(1.0, 0.0, 1.0), end_position=(1.1, 0.0, 1.0))
    assert push_force(NOWHERE, drag) == pytest.approx((0.1 * STIFFNESS_N_M, 0.0, 0.0))
    turned = Pose.from_abc_deg((5.0, 5.0, 0.0), 90.0, 0.0, 0.0)
    assert push_force(turned, drag) == pytest.approx((0.0, -0.1 * STIFFNESS_N_M, 0.0), abs=1e-9)


def test_a_drag_is_never_stronger_than_a_person() -> None:
    drag = SimpleNamespace(start_position=(0.0, 0.0, 0.0), end_position=(3.0, 4.0, 0.0))
    assert push_force(NOWHERE, drag) == pytest.approx((0.6 * MOST_N, 0.8 * MOST_N, 0.0))
    nothing = SimpleNamespace(start_position=(1.0, 1.0, 1.0), end_position=(1.0, 1.0, 1.0))
    assert push_force(NOWHERE, nothing) == (0.0, 0.0, 0.0)
