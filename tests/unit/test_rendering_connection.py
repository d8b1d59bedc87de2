"""A rendering connection: what is possible when, the choices kept with the station, who is lost (manual, chapter 6)."""

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from pathlib import Path

import pytest

from hil.values.errors import ConfigurationError, EndpointError, UnknownName, UsageError
from hil.values.frames import FrameTree
from tools.view.choices import BROWSER, COPPELIASIM, Choices, choices_path, keep_choices, load_choices
from tools.view.connection import NOT_WATCHED, TABLE, Action, NotPossible, RenderingConnection, State
from tools.view.drawing import ArmNow, DrawnRobot

HERE = ArmNow(None)
GONE = ArmNow(None, "the controller was silent for 3 s")


class Drawn:
    """A renderer that notes what it is told."""

    title = "drawn"

    def __init__(self, *devices: str) -> None:
        self.room: tuple[str, ...] = devices
        self.told: list[str] = []
        self.shown: dict[str, ArmNow] = {}
        self.fails = ""

    def load_scene(self, scene: str, robots: Sequence[DrawnRobot]) -> None:
        self._note(f"load {scene} for {' '.join(one.name for one in robots)}")

    def devices(self) -> tuple[str, ...]:
        return self.room

    def start(self, devices: Mapping[str, str]) -> None:
        self._note(f"start {dict(devices)}")

    def show(self, robots: Mapping[str, ArmNow]) -> None:
        self.shown = dict(robots)
        self._note("show")

    def synchronise_frames(self) -> int:
        self._note("frames")
        return 6

    def stop(self) -> None:
        self._note("stop")

    def close(self) -> None:
        self._note("close")

    def _note(self, what: str) -> None:
        if self.fails:
            raise EndpointError(self.fails)
        self.told.append(what)


class Keeping(Drawn):
    """One that keeps its scene when the station changes."""

    def reconfigure(self, robots: Sequence[DrawnRobot]) -> None:
        self._note(f"again for {' '.join(one.name for one in robots)}")


class Station:
    """What a station file says."""

    def __init__(self, *names: str) -> None:
        self.names = names

    def read(self, station: Path) -> tuple[DrawnRobot, ...]:
        return tuple(DrawnRobot(name, "lbr-iiwa-7-r800", FrameTree()) for name in self.names)


def connection(renderer: Drawn, station: Station) -> RenderingConnection:
    return RenderingConnection(renderer, kind=COPPELIASIM, read_station=station.read)


def led_to(state: State, tmp_path: Path, renderer: Drawn | None = None) -> RenderingConnection:
    """Return a connection in ``state``."""
    (tmp_path / "cell.toml").touch()
    one = connection(renderer or Drawn("/arm", "/other"), Station("left", "right"))
    for reached in list(State)[1 : list(State).index(state) + 1]:
        if reached is State.STATION:
            one.select_station(tmp_path / "cell.toml")
        elif reached is State.SCENE_CHOSEN:
            one.select_scene("cell.ttt")
        elif reached is State.LOADED:
            one.load_scene()
        else:
            one.assign("left", "/arm")
            one.start_live_view()
    assert one.state is state
    return one


def do(one: RenderingConnection, action: Action, tmp_path: Path) -> None:
    if action is Action.START_LIVE_VIEW and one.state is State.LOADED:
        one.assign("left", "/arm")
    deeds: dict[Action, Callable[[], object]] = {
        Action.SELECT_STATION: lambda: one.select_station(tmp_path / "other.toml"),
        Action.SELECT_SCENE: lambda: one.select_scene("other.ttt"),
        Action.LOAD_SCENE: one.load_scene,
        Action.ASSIGN_DEVICE: lambda: one.assign("left", "/arm"),
        Action.START_LIVE_VIEW: one.start_live_view,
        Action.STOP_LIVE_VIEW: one.stop_live_view,
        Action.SYNCHRONISE_FRAMES: one.synchronise_frames,
        Action.REFRESH: one.refresh,
    }
    deeds[action]()


@pytest.mark.parametrize(("state", "action"), list(product(State, Action)))
def test_each_action_does_what_the_table_says_or_says_what_to_do_first(
    state: State, action: Action, tmp_path: Path
) -> None:
    one = led_to(state, tmp_path)
    possible = one.possible(action)
    assert possible is ((state, action) in TABLE)
    if possible:
        do(one, action, tmp_path)
        assert one.state is TABLE[state, action]
    else:
        with pytest.raises(NotPossible, match=r" first$|^the live view is on already$"):
            do(one, action, tmp_path)
        assert one.state is state


def test_the_scene_can_only_be_loaded_with_a_station_and_a_scene(tmp_path: Path) -> None:
    one = connection(Drawn(), Station("left"))
    with pytest.raises(NotPossible) as refused:
        one.load_scene()
    assert str(refused.value) == "loading the scene is not possible now (no station): select a station first"
    one.select_station(tmp_path / "cell.toml")
    with pytest.raises(NotPossible, match="select a scene first"):
        one.load_scene()
    with pytest.raises(UsageError, match="empty"):
        one.select_scene("")


def test_a_live_view_needs_a_robot_to_show(tmp_path: Path) -> None:
    one = led_to(State.LOADED, tmp_path)
    with pytest.raises(NotPossible, match=r"the scene has /arm, /other, the station left, right$"):
        one.start_live_view()
    assert one.state is State.LOADED


def test_each_robot_is_one_of_the_scene(tmp_path: Path) -> None:
    one = led_to(State.LOADED, tmp_path)
    with pytest.raises(UnknownName, match="unknown robot of the scene '/amr'; valid: /arm, /other"):
        one.assign("left", "/amr")
    with pytest.raises(UnknownName, match="unknown robot of the station 'middle'; valid: left, right"):
        one.assign("middle", "/arm")
    one.assign("left", "/arm")
    with pytest.raises(UsageError, match="'/arm' of the scene shows the robot 'left' already"):
        one.assign("right", "/arm")
    one.assign("left", "")
    one.assign("right", "/arm")
    assert [row.device for row in one.rows()] == ["", "/arm"]


@pytest.mark.parametrize(("devices", "names"), [(("/arm",), ("left",)), (("left", "right"), ("right", "left"))])
def test_where_there_is_one_choice_it_is_made(tmp_path: Path, devices: tuple[str, ...], names: tuple[str, ...]) -> None:
    one = connection(Drawn(*devices), Station(*names))
    one.select_station(tmp_path / "cell.toml")
    one.select_scene("cell.ttt")
    one.load_scene()
    assert [row.device for row in one.rows()] == [name if name in devices else "/arm" for name in names]


def test_the_choices_are_kept_with_the_station(tmp_path: Path) -> None:
    led_to(State.LIVE, tmp_path)
    renderer = Drawn("/arm", "/other")
    again = connection(renderer, Station("left", "right"))
    again.select_station(tmp_path / "cell.toml")
    assert (again.state, again.scene) == (State.SCENE_CHOSEN, "cell.ttt")
    again.load_scene()
    again.start_live_view()
    assert renderer.told == ["load cell.ttt for left right", "start {'left': '/arm'}"]


def test_nothing_is_kept_beside_a_station_that_is_no_file(tmp_path: Path) -> None:
    one = connection(Drawn("/arm"), Station("left"))
    one.select_station(tmp_path / "cell.toml")
    one.select_scene("cell.ttt")
    assert list(tmp_path.iterdir()) == []


def test_a_lost_robot_says_so_in_its_row_and_is_drawn_so(tmp_path: Path) -> None:
    renderer = Drawn("/arm", "/other")
    one = led_to(State.LIVE, tmp_path, renderer)
    assert [row.lost for row in one.rows()] == [NOT_WATCHED, NOT_WATCHED]
    one.show({"left": GONE, "right": HERE})
    assert [row.lost for row in one.rows()] == [GONE.lost, ""]
    assert renderer.shown == {"left": GONE}
    one.show({"left": HERE})
    assert [row.lost for row in one.rows()] == ["", NOT_WATCHED]


def test_a_renderer_that_fails_is_left_alone_until_a_refresh(tmp_path: Path) -> None:
    renderer = Keeping("/arm", "/other")
    one = led_to(State.LIVE, tmp_path, renderer)
    renderer.fails = "nobody answers"
    one.show({"left": HERE})
    assert (one.state, one.trouble) == (State.LIVE, "nobody answers")
    renderer.fails = ""
    one.show({"left": HERE})
    assert "show" not in renderer.told
    renderer.fails = "nobody answers"
    with pytest.raises(EndpointError, match="nobody answers"):
        one.refresh()
    assert (one.state, one.trouble) == (State.LIVE, "nobody answers")
    renderer.fails = ""
    renderer.told.clear()
    one.refresh()
    one.show({"left": HERE})
    assert (one.state, one.trouble) == (State.LIVE, "")
    assert renderer.told == ["again for left right", "start {'left': '/arm'}", "show"]


def test_a_live_view_with_a_dead_renderer_can_be_stopped(tmp_path: Path) -> None:
    renderer = Drawn("/arm", "/other")
    one = led_to(State.LIVE, tmp_path, renderer)
    renderer.fails = "nobody answers"
    one.show({"left": HERE})
    one.stop_live_view()
    assert one.state is State.LOADED


def test_refresh_takes_the_changed_station_and_the_changed_scene(tmp_path: Path) -> None:
    renderer, station = Drawn("/arm", "/other"), Station("left")
    one = connection(renderer, station)
    one.select_station(tmp_path / "cell.toml")
    one.select_scene("cell.ttt")
    one.load_scene()
    one.assign("left", "/arm")
    one.start_live_view()
    renderer.told.clear()
    station.names, renderer.room = ("left", "right"), ("/arm", "right")
    one.refresh()
    assert renderer.told == ["stop", "load cell.ttt for left right", "start {'left': '/arm', 'right': 'right'}"]
    renderer.room = ("/another",)
    with pytest.raises(NotPossible, match="needs a robot to show"):
        one.refresh()
    assert "needs a robot to show" in one.trouble


def test_choices_of_each_renderer_are_its_own(tmp_path: Path) -> None:
    station = tmp_path / "cell.toml"
    ours = Choices(scene='C:\\scenes\\"cell".ttt', devices={"left arm": "/LBRiiwa14R820[0]", "ü\x7f": "/b"})
    keep_choices(station, COPPELIASIM, ours)
    keep_choices(station, BROWSER, Choices(scene="objects"))
    assert load_choices(station, COPPELIASIM) == ours
    assert load_choices(station, BROWSER) == Choices(scene="objects")
    assert [path.name for path in tmp_path.iterdir()] == ["cell.rendering.toml"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("scene = ", "is no TOML"),
        ('[coppeliasim]\nscnee = "a"', "coppeliasim.scnee: Extra inputs are not permitted"),
        ("[coppeliasim]\nscene = 3", "coppeliasim.scene: Input should be a valid string"),
        ('[vrep]\nscene = "a"', "vrep: Extra inputs are not permitted"),
    ],
)
def test_a_broken_file_is_told_and_left_as_it_is(tmp_path: Path, text: str, said: str) -> None:
    station = tmp_path / "cell.toml"
    path = choices_path(station)
    path.write_text(text, encoding="utf-8")
    for attempt in (
        lambda: load_choices(station, COPPELIASIM),
        lambda: keep_choices(station, COPPELIASIM, Choices(scene="b")),
    ):
        with pytest.raises(ConfigurationError) as told:
            attempt()
        assert str(path) in str(told.value)
        assert said in str(told.value)
        assert str(told.value).endswith("repair it, or remove it to choose anew")
    assert path.read_text(encoding="utf-8") == text


def test_a_folder_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"cannot keep the choices for .*: No such file or directory"):
        keep_choices(tmp_path / "nowhere" / "cell.toml", COPPELIASIM, Choices(scene="a"))
