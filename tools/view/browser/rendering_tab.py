"""The rendering connection in the page: station, scene, live view, frames, and who is lost (manual 6.1 to 6.4)."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import viser

from hil.values.errors import ConfigurationError
from tools.view.browser import cards
from tools.view.browser.renderer import EMPTY_SCENE, STATION_SCENE
from tools.view.connection import Action, RenderingConnection

_SCENES: Final = (STATION_SCENE, EMPTY_SCENE)

Do = Callable[[Callable[[RenderingConnection], object]], None]
"""Has something done with the connection by the thread that draws, and says why where that was refused."""


class RenderingTab:
    """Elements of one browser; ``do`` is None where it only looks."""

    def __init__(
        self, gui: "viser.GuiApi", connection: RenderingConnection, do: Do | None, refresh: Callable[[], object]
    ) -> None:
        self._connection = connection
        self._rows = gui.add_html("")
        self._said = ""
        self._buttons: dict[Action, Any] = {}
        if do is None:
            return
        station = gui.add_text("station", str(connection.station or ""), hint="station file (TOML)")
        select = gui.add_button("Select station", color="gray")
        select.on_click(lambda _event: do(lambda one: one.select_station(_file(station.value))))
        scene = gui.add_dropdown("scene", _SCENES, initial_value=connection.scene or STATION_SCENE)
        scene.on_update(lambda _event: do(lambda one: one.select_scene(scene.value)))
        for action, label, done in (
            (Action.LOAD_SCENE, "Load scene", RenderingConnection.load_scene),
            (Action.START_LIVE_VIEW, "Start live view", RenderingConnection.start_live_view),
            (Action.STOP_LIVE_VIEW, "Stop live view", RenderingConnection.stop_live_view),
            (Action.SYNCHRONISE_FRAMES, "Synchronise frames", RenderingConnection.synchronise_frames),
        ):
            button = self._buttons[action] = gui.add_button(label)
            button.on_click(_doing(do, done))
        again = gui.add_button("Refresh: station and robots", hint="after a change, or where a robot was lost")
        again.on_click(_ignoring(refresh))

    def update(self) -> None:
        """Show how far the connection is."""
        connection = self._connection
        content = cards.rows_card(connection.state.value, connection.trouble, connection.rows())
        if content != self._said:
            self._said = self._rows.content = content
        for action, button in self._buttons.items():
            disabled = not connection.possible(action)
            if button.disabled != disabled:
                button.disabled = disabled


def _file(typed: str) -> Path:
    path = Path(typed.strip())
    if not path.name or "\0" in typed:
        raise ConfigurationError(f"{typed!r} is no station file")
    return path


def _doing(do: Do, action: Callable[[RenderingConnection], object]) -> Callable[[object], None]:
    def clicked(_event: object) -> None:
        do(action)

    return clicked


def _ignoring(action: Callable[[], object]) -> Callable[[object], None]:
    def clicked(_event: object) -> None:
        action()

    return clicked
