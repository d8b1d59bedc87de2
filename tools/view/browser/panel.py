"""The pad in the page of one browser: what it shows, and, for whoever has the operator's token, what it does."""

import asyncio
import threading
from collections.abc import Callable, Coroutine, Sequence
from functools import partial
from typing import Any, Final

import numpy as np
import viser

from backends.robots import load_description
from hil.client.pad import PadClient, RobotState
from hil.values.errors import HilError, UsageError
from hil.values.frames import FLANGE
from hil.values.fri import OperationMode
from hil.values.robot import JOINT_NAMES
from tools.view.browser import cards
from tools.view.browser.renderer import BrowserRenderer
from tools.view.browser.rendering_tab import Do, RenderingTab
from tools.view.connection import RenderingConnection
from tools.view.jog import Jogger, JogKey, Space
from tools.view.operator import HOLD_HZ, Operator
from tools.view.watch import Watch

_MODES: Final = ("T1", "T2", "AUT")
_DIRECTIONS: Final = ("X", "Y", "Z", "A", "B", "C")
_PLOT_EVERY: Final = 10
"""Updates of the panel to one of the plots."""
_PLOTS: Final = {
    "answer_ms": ("FRI client's answer after our message, ms", "#1971c2"),
    "cycle_ms": ("control cycle began late by, ms", "#e8590c"),
}
"""What is plotted of a robot's times: title and colour."""
_WIDTH_PX: Final = 440
_RED: Final = "red"


def tell(client: "viser.ClientHandle", text: str) -> None:
    """Tell one browser why something was not done."""
    client.add_notification("fri-hil", text, auto_close_seconds=8.0, color=_RED)


class Panel:
    """Of one client; ``operator`` is None where it only looks. Updates come from one thread, events from others."""

    def __init__(
        self,
        client: "viser.ClientHandle",
        watch: Watch,
        renderer: BrowserRenderer,
        connection: RenderingConnection,
        *,
        operator: Operator | None,
        give_token: Callable[[str], None],
        do: Do,
        refresh: Callable[[], object],
    ) -> None:
        self._client = client
        self._gui = client.gui
        self._watch = watch
        self._renderer = renderer
        self._operator = operator
        self._connection = connection
        self._do, self._refresh = do, refresh
        self._rendering: RenderingTab | None = None
        self._give_token = give_token
        self._robot = watch.robots[0].name
        self._joggers: dict[str, Jogger] = {}
        self._lock = threading.RLock()
        self._updates = 0
        self._cards: dict[str, Any] = {}
        self._said: dict[str, str] = {}
        self._override: Any = None
        self._plots: dict[str, Any] = {}
        self._build()
        self._gui.main_panel.dock_right()
        self._gui.main_panel.set_width(_WIDTH_PX)

    def close(self) -> None:
        """Let go of what is held; the browser is gone."""
        for jogger in list(self._joggers.values()):
            jogger.release()
        if self._operator is not None:
            self._operator.close()
        for jogger in list(self._joggers.values()):
            jogger.close()

    def update(self) -> None:
        """Show what is now."""
        with self._lock:
            self._updates += 1
            now = self._watch.now().get(self._robot)
            pad = self._watch.pad().get(self._robot)
            if now is None:
                return
            self._tell("status", cards.status_card(self._robot, now, pad))
            snapshot = now.snapshot
            if snapshot is not None:
                self._tell("speed", cards.speed_card(snapshot, pad))
                self._tell("axes", cards.axes_card(snapshot, self._limits))
                self._tell("pose", cards.pose_card("flange in the robot base", snapshot.flange_in_base))
            self._tell("messages", cards.messages_card(self._watch.messages()))
            self._tell("signals", cards.signals_card(pad))
            if self._rendering is not None:
                self._rendering.update()
            if self._updates % _PLOT_EVERY == 1:
                self._draw_latency()

    def _tell(self, name: str, content: str) -> None:
        if self._said.get(name) != content:
            self._said[name] = content
            self._cards[name].content = content

    def _build(self) -> None:
        """Make all elements anew, for the robot that is chosen."""
        with self._lock:
            gui = self._gui
            gui.reset()
            self._cards.clear()
            self._said.clear()
            self._drawn = next(one for one in self._watch.robots if one.name == self._robot)
            self._limits = load_description(self._drawn.model).limits
            names = [robot.name for robot in self._watch.robots]
            if len(names) > 1:
                choice = gui.add_dropdown("robot", names, initial_value=self._robot)
                choice.on_update(lambda _event: self._choose_robot(choice.value))
            if self._operator is not None:
                stop = gui.add_button("EMERGENCY STOP", color=_RED, icon=viser.Icon.HAND_STOP)
                stop.on_click(_at_once(self._operator.stop_everything))
            self._card("status")
            if self._operator is not None:
                self._build_keys(self._operator)
            else:
                self._build_token()
            self._card("speed")
            tabs = gui.add_tab_group()
            with tabs.add_tab("Axes"):
                self._card("axes")
                self._card("pose")
            if self._operator is not None:
                with tabs.add_tab("Jog"):
                    self._build_jog(self._operator)
            with tabs.add_tab("I/O"):
                self._card("signals")
                if self._operator is not None:
                    self._build_inputs(self._operator)
            with tabs.add_tab("Messages"):
                self._card("messages")
            with tabs.add_tab("Latency"):
                self._build_latency()
            # What is chosen there is chosen for all who look; where nobody can act, nobody is disturbed.
            if self._operator is not None or self._watch.sources.pad is None:
                with tabs.add_tab("View"):
                    self._build_view()
            with tabs.add_tab("Rendering"):
                do = None if self._operator is None else self._do
                self._rendering = RenderingTab(gui, self._connection, do, self._refresh)

    def _card(self, name: str) -> None:
        self._cards[name] = self._gui.add_html("")

    def _choose_robot(self, name: str) -> None:
        if name not in {one.name for one in self._watch.robots}:
            return
        self._let_go(self._robot)
        self._robot = name
        self._build()

    def _build_token(self) -> None:
        if self._watch.sources.pad is None:
            self._gui.add_markdown("*Only to look at: the controller's pad is not on this machine.*")
            return
        field = self._gui.add_text("operator's token", "", hint="hil view printed it; without it the page only shows")
        field.on_update(lambda _event: self._give_token(field.value))

    def _build_keys(self, operator: Operator) -> None:
        gui = self._gui
        enabling = gui.add_button("Enabling switch: hold", color="gray", hint="for as long as the button is pressed")
        # A key is its robot's: the last words of one that was held may come when another robot is chosen.
        robot = self._robot
        enabling.on_hold(_held(operator, lambda grip: operator.hold(robot, grip=grip)), callback_hz=HOLD_HZ)
        enabling.on_click(_let_go(operator, lambda: operator.release(robot)))
        run = gui.add_button("Enabling switch and start: hold", color="green", icon=viser.Icon.PLAYER_PLAY)
        run.on_hold(_held(operator, lambda grip: _run_while_held(operator, robot, grip)), callback_hz=HOLD_HZ)
        run.on_click(_let_go(operator, lambda: operator.release(robot)))
        self._buttons(
            ("Start", "Pause", "Reset"),
            {"Start": PadClient.start, "Pause": PadClient.pause, "Reset": PadClient.reset},
        )
        modes = gui.add_button_group("mode", _MODES)
        modes.on_click(lambda _event: self._press(lambda pad: pad.select_mode(modes.value)))
        override = gui.add_slider("override %", min=0, max=100, step=1, initial_value=self._override_percent())
        override.on_update(lambda _event: self._press(lambda pad: pad.set_override(override.value)))

    def _override_percent(self) -> int:
        pad = self._watch.pad().get(self._robot)
        return 100 if pad is None else round(pad["override_percent"])

    def _buttons(self, names: Sequence[str], keys: dict[str, Callable[[PadClient], object]]) -> None:
        group = self._gui.add_button_group("program", names)
        group.on_click(lambda _event: self._press(keys[group.value]))

    def _press(self, key: Callable[[PadClient], object]) -> None:
        if self._operator is not None:
            self._operator.press(self._robot, key)

    def _build_jog(self, operator: Operator) -> None:
        gui = self._gui
        space = gui.add_dropdown("what", [one.value for one in Space], initial_value=Space.AXIS.value)
        moving = [frame.name for frame in self._drawn.frames.values() if frame.moves]
        frame = gui.add_dropdown("frame", moving, initial_value=FLANGE)
        axis = gui.add_button_group("axis", JOINT_NAMES)
        direction = gui.add_button_group("direction", _DIRECTIONS)
        speed = gui.add_slider("speed %", min=1, max=100, step=1, initial_value=30)
        gui.add_html(cards.note("A jog key holds the enabling switch too, and presses start. It works in T1 and T2."))
        number = {"axis": 0, "direction": 0}

        def name() -> str:
            names = JOINT_NAMES if space.value == Space.AXIS else _DIRECTIONS
            return names[number["axis" if space.value == Space.AXIS else "direction"]]

        def tell() -> None:
            cartesian = space.value != Space.AXIS
            axis.visible, direction.visible, frame.visible = not cartesian, cartesian, cartesian
            more.label, less.label = f"{name()} +: hold", f"{name()} −: hold"

        def key(sign: int) -> JogKey:
            which = number["axis" if space.value == Space.AXIS else "direction"]
            return JogKey(Space(space.value), which, sign, speed.value / 100.0, frame.value)

        robot = self._robot

        def held(sign: int, grip: int) -> None:
            self._jog(operator, robot, key(sign), grip)

        more = gui.add_button("+", color="blue", icon=viser.Icon.PLUS)
        less = gui.add_button("-", color="blue", icon=viser.Icon.MINUS)
        for button, sign in ((more, 1), (less, -1)):
            button.on_hold(_held(operator, partial(held, sign)), callback_hz=HOLD_HZ)
            button.on_click(_let_go(operator, partial(self._let_go, robot)))

        def choose(of: str, names: Sequence[str], value: str) -> None:
            number[of] = list(names).index(value)
            tell()

        axis.on_click(lambda _event: choose("axis", JOINT_NAMES, axis.value))
        direction.on_click(lambda _event: choose("direction", _DIRECTIONS, direction.value))
        space.on_update(lambda _event: tell())
        tell()

    def _jog(self, operator: Operator, robot: str, key: JogKey, grip: int) -> None:
        if not operator.hold(robot, grip=grip):
            return
        with self._lock:
            if robot not in self._joggers:
                model = next(one.model for one in self._watch.robots if one.name == robot)
                self._joggers[robot] = Jogger(
                    self._watch.source(robot),
                    model,
                    press_start=lambda: operator.press(robot, PadClient.start),
                    say=lambda text: tell(self._client, text),
                )
            jogger = self._joggers[robot]
        try:
            jogger.hold(key)
        except HilError as refused:
            operator.release(robot)
            tell(self._client, str(refused))
        if grip != operator.grip:
            jogger.release()

    def _let_go(self, robot: str) -> None:
        if self._operator is None:
            return
        for jogger in list(self._joggers.values()):
            jogger.release()
        self._operator.release(robot)

    def _build_inputs(self, operator: Operator) -> None:
        pad: RobotState | None = self._watch.pad().get(self._robot)
        for name, info in ({} if pad is None else pad["io"]).items():
            if info["direction"] != "input":
                continue
            value = info["value"]
            field: Any
            if isinstance(value, bool):
                field = self._gui.add_checkbox(name, value)
            elif isinstance(value, int):
                field = self._gui.add_number(name, value, step=1)
            else:
                field = self._gui.add_number(name, value, step=0.01)
            field.on_update(self._setter(operator, name, field))

    def _setter(self, operator: Operator, name: str, field: Any) -> Callable[[object], object]:
        return lambda _event: operator.press(self._robot, lambda pad: pad.set_input(name, field.value))

    def _build_latency(self) -> None:
        self._plots = {what: self._plot_of(*look) for what, look in _PLOTS.items()}
        self._gui.add_html(cards.note("Looked at five times a second; the last minute."))

    def _plot_of(self, title: str, colour: str) -> Any:
        return self._gui.add_uplot(
            (np.zeros(1), np.zeros(1)),
            ({"label": "s"}, {"label": "ms", "stroke": colour, "width": 1.5}),
            title=title,
            scales={"x": {"time": False}},
            height=170,
        )

    def _draw_latency(self) -> None:
        times = self._watch.latencies(self._robot)
        for what, plot in self._plots.items():
            points = [(one.at_s, value) for one in times if (value := getattr(one, what)) is not None]
            if points:
                plot.data = tuple(np.array(points, np.float64).T)

    def _build_view(self) -> None:
        gui, shown = self._gui, self._renderer.shown
        for name, label in (
            ("set_point", "ghost of the set point"),
            ("trail", "trail of the flange"),
            ("frames", "frames of the station"),
            ("forces", "external and contact forces"),
        ):
            box = gui.add_checkbox(label, getattr(shown, name))
            box.on_update(self._chooser(name, box))
        clear = gui.add_button("Clear the trail")
        clear.on_click(lambda _event: self._do(lambda _connection: self._renderer.clear_trails()))

    def _chooser(self, name: str, box: Any) -> Callable[[object], None]:
        def choose(_connection: object) -> None:
            setattr(self._renderer.shown, name, box.value)
            self._renderer.choose()

        return lambda _event: self._do(choose)


def _run_while_held(operator: Operator, robot: str, grip: int) -> None:
    held_before = operator.holds(robot)
    if operator.hold(robot, grip=grip) and not held_before:
        operator.press(robot, partial(_start_what_stops, robot))


def _start_what_stops(robot: str, pad: PadClient) -> None:
    if pad.status()[robot]["mode"] == OperationMode.AUT.name:
        raise UsageError("AUT runs on when the key is let go: press Start, and Pause; this key is for T1 and T2")
    pad.start()


def _at_once(action: Callable[[], object]) -> Callable[[object], Coroutine[Any, Any, None]]:
    """Do it in a thread of its own: viser's are few, and may all wait for something."""

    async def clicked(_event: object) -> None:
        threading.Thread(target=action, name="at once", daemon=True).start()

    return clicked


def _held(operator: Operator, action: Callable[[int], object]) -> Callable[[object], Coroutine[Any, Any, None]]:
    """Do it in a thread, with the grip as it was when the browser said so: here everything comes in its order."""

    async def held(_event: object) -> None:
        asyncio.get_running_loop().run_in_executor(None, action, operator.grip)

    return held


def _let_go(operator: Operator, action: Callable[[], object]) -> Callable[[object], Coroutine[Any, Any, None]]:
    """Let nothing that was said before hold any more, and do it in a thread of its own."""

    async def clicked(event: object) -> None:
        operator.begin_release()
        await _at_once(action)(event)

    return clicked
