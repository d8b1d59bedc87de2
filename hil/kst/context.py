"""What a job is done with."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from hil.client.servo import AsyncServoClient
from hil.kst.registers import Registers
from hil.values.kst import KstSettings

OPERATORS_PATIENCE_S: Final = 86_400.0
"""A motion may wait for the operator's start key as long as he likes."""
NEVER_S: Final = 1e6
"""A servo motion that rests does not end by itself."""


@dataclass(frozen=True, slots=True)
class Context:
    """One job's: the client that commands, the session's set-points, and whether somebody asked for the end."""

    client: AsyncServoClient
    registers: Registers
    settings: KstSettings
    tell: Callable[[str], None]
    now_ns: Callable[[], int]
    stop: asyncio.Event = field(default_factory=asyncio.Event)
