"""Wireshark's dissector of FRI and the servo link: one Lua file, which ``tools/make_dissector.py`` writes."""

from pathlib import Path
from typing import Final

DISSECTOR: Final = Path(__file__).with_name("fri_hil.lua")
"""What Wireshark loads."""
FIRST_LINE: Final = "-- Wireshark's dissector of KUKA's Fast Robot Interface and of fri-hil's servo link."
"""By which a file is known to be ours."""
