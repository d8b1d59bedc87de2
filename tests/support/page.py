"""The page of ``hil view`` in a real browser, used as a person uses it: seen, clicked, held, typed into."""

import json
from pathlib import Path
from typing import Any

from tests.support.chromium import Browser, Opened

_SCENES = """
window.__THREE_DEVTOOLS__ = new EventTarget();
window.scenes = [];
window.__THREE_DEVTOOLS__.addEventListener("observe", event => {
    if (event.detail.isScene) window.scenes.push(event.detail);
});
"""
"""three.js tells whoever looks for it of its scenes, and so of what is really drawn."""
_LOOKS = 300
_LOOK_MS = 100
_PRESSED = "button, [role=tab], label"


class Page:
    """A tab with the page in it."""

    def __init__(self, browser: Browser, address: str, *, width: int = 1400, height: int = 900) -> None:
        self.opened: Opened = browser.open(address, width=width, height=height, before=_SCENES)

    def wait_ms(self, time_ms: float) -> None:
        """Let the page's time pass."""
        self.opened.run(f"new Promise(done => setTimeout(done, {time_ms}))")

    def wait_until(self, condition: str) -> Any:
        """Look again and again until an expression is true; return its value."""
        for _ in range(_LOOKS):
            if value := self.opened.run(condition):
                return value
            self.wait_ms(_LOOK_MS)
        raise AssertionError(f"never in {_LOOKS * _LOOK_MS / 1e3:g} s: {condition}\n{self.text()}")

    def wait_for_text(self, text: str) -> None:
        """Wait until it is read on the page."""
        self.wait_until(f"document.body.innerText.includes({json.dumps(text)})")

    def wait_until_complete(self) -> None:
        """Wait until the panel has its values: it has all its parts then, and begins with the tab of the axes."""
        self.wait_for_text("between its ends")

    def text(self) -> str:
        """Return all that is read on the page."""
        return str(self.opened.run("document.body.innerText"))

    def place(self, text: str, *, kind: str = _PRESSED) -> tuple[float, float]:
        """Return where something with that text is, once it stands still and nothing is before it."""
        script = f"""(() => {{
            const found = [...document.querySelectorAll({json.dumps(kind)})].reverse()
                .find(one => one.textContent.includes({json.dumps(text)}) && one.offsetParent !== null);
            if (!found) return null;
            const box = found.getBoundingClientRect();
            const at = [box.x + box.width / 2, box.y + box.height / 2];
            const hit = document.elementFromPoint(...at);
            return hit && (found.contains(hit) || hit.closest({json.dumps(kind)}) === found) ? at : null;
        }})()"""
        before = None
        for _ in range(_LOOKS):
            at = self.opened.run(script)
            if at is not None and at == before:
                return at[0], at[1]
            before = at
            self.wait_ms(_LOOK_MS)
        raise AssertionError(f"nothing to press says {text!r}:\n{self.text()}")

    def press(self, at: tuple[float, float]) -> None:
        """Press the mouse, and keep it pressed."""
        self._mouse("mousePressed", at, buttons=1)

    def let_go(self, at: tuple[float, float]) -> None:
        """Let the mouse go."""
        self._mouse("mouseReleased", at, buttons=0)

    def move(self, at: tuple[float, float], *, buttons: int = 0) -> None:
        """Move the mouse."""
        self._mouse("mouseMoved", at, buttons=buttons)

    def click(self, text: str, *, kind: str = _PRESSED) -> None:
        """Click on what says that."""
        at = self.place(text, kind=kind)
        self.press(at)
        self.let_go(at)

    def type(self, text: str, *, into: str) -> None:
        """Type into the field with that label."""
        field = f"""(() => {{
            let beside = [...document.querySelectorAll("*")].reverse()
                .find(one => one.textContent.trim() === {json.dumps(into)});
            while (beside && !beside.querySelector("input")) beside = beside.parentElement;
            return beside && beside.querySelector("input");
        }})()"""
        self.wait_until(f"{field} instanceof HTMLElement")
        self.opened.run(f"{field}.focus(); {field}.select()")
        self.opened.call("Input.insertText", text=text)

    def close(self) -> None:
        """Close the tab, as one closes a tab."""
        self.opened.call("Page.close")

    def picture(self, file: Path) -> Path:
        """Write what is seen."""
        return self.opened.picture(file, whole=False)

    def drawn(self, vertices: int) -> list[list[float]]:
        """Return the matrices, in the page's world, of the meshes that are drawn of so many vertices: 16 numbers each.

        Columns one after the other, y upwards, as three.js has them.
        """
        found: list[list[float]] = self.opened.run(
            f"""(() => {{
                const found = [];
                window.scenes[0].traverse(one => {{
                    if (one.isMesh && one.geometry.attributes.position.count === {vertices})
                        found.push([...one.matrixWorld.elements]);
                }});
                return found;
            }})()"""
        )
        return found

    def _mouse(self, kind: str, at: tuple[float, float], *, buttons: int) -> None:
        x, y = at
        button = "left" if kind != "mouseMoved" or buttons else "none"
        self.opened.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button=button, buttons=buttons, clickCount=1)
