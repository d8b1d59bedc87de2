"""The page's cards show the words of peers as words: none of them becomes a part of the page."""

from typing import Any, cast

import pytest

from hil.client.pad import RobotState
from tools.view.browser import cards
from tools.view.connection import Row
from tools.view.drawing import ArmNow
from tools.view.watch import Message

HOSTILE = "<img src=x onerror='steal()'>\"&"
SIGNAL = {"type": "boolean", "direction": HOSTILE, "value": True, "fri": True}


@pytest.mark.parametrize(
    "shown",
    [
        cards.status_card(HOSTILE, ArmNow(None, HOSTILE), None),
        cards.status_card(HOSTILE, ArmNow(None), None),
        cards.messages_card([Message(HOSTILE, 1.0, HOSTILE)]),
        cards.signals_card(cast("RobotState", cast("Any", {"io": {HOSTILE: SIGNAL}}))),
        cards.rows_card(HOSTILE, HOSTILE, [Row(HOSTILE, HOSTILE, HOSTILE, HOSTILE), Row(HOSTILE, "", "", "")]),
        cards.note(HOSTILE),
    ],
)
def test_words_of_a_peer_stay_words(shown: str) -> None:
    assert "<img" not in shown
    assert "&lt;img src=x onerror=&#x27;steal()&#x27;&gt;&quot;&amp;" in shown
