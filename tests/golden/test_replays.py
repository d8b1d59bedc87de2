"""Recordings that every version replays: ours to the byte, those of real client programs to where they part."""

import json
from pathlib import Path
from typing import Any

import pytest

from hil.arithmetic import arithmetic_fingerprint
from hil.replay.replay import replay_file
from hil.replay.result import ReplayResult
from hil.runtime.capture_header import ARITHMETIC
from tests.support.captures import FOLDER, files
from tests.support.recordings import header_of
from tools.goldens import GOLDENS, parting, write_golden

DATA = Path(__file__).parents[1] / "data"
ELSEWHERE: dict[str, Any] = json.loads((DATA / "elsewhere.json").read_text(encoding="utf-8"))
LAST_DIGITS = 1e-6
"""What another processor may make of a recording, in the units of the fields; see hil/arithmetic.py."""

needs_captures = pytest.mark.skipif(not FOLDER.is_dir(), reason=f"{FOLDER} is not there")


def test_the_recordings_are_those_of_the_list() -> None:
    assert {file.stem for file in DATA.glob("*.pcapng")} == {golden.name for golden in GOLDENS}


@pytest.mark.parametrize("name", [golden.name for golden in GOLDENS])
def test_our_recordings_replay_to_the_byte(name: str) -> None:
    result = replay_file(DATA / f"{name}.pcapng")
    assert same(result), result.verdict
    assert result.complete
    assert not result.notes
    assert result.compared > 150


def same(result: ReplayResult) -> bool:
    """Whether it is identical, or only as far from it as another processor's rounding."""
    if result.equal:
        return True
    whole = not (result.missing or result.extra or result.altered)
    return result.other_arithmetic and whole and result.largest < LAST_DIGITS


@pytest.mark.parametrize("golden", GOLDENS, ids=[golden.name for golden in GOLDENS])
def test_the_same_run_makes_the_same_recording(golden: Any, tmp_path: Path) -> None:
    file = write_golden(golden, tmp_path)
    recorded = DATA / f"{golden.name}.pcapng"
    if header_of(recorded).machine[ARITHMETIC] != arithmetic_fingerprint():
        assert same(replay_file(recorded))
        return
    # The header tells of the machine; what passed is the same.
    assert file.read_bytes()[-file.stat().st_size // 2 :] == recorded.read_bytes()[-file.stat().st_size // 2 :]
    assert same(replay_file(file))


@needs_captures
def test_every_capture_has_its_golden() -> None:
    assert {file.stem for file in files()} == set(ELSEWHERE)


@needs_captures
@pytest.mark.parametrize("name", sorted(ELSEWHERE))
def test_recordings_of_real_clients_part_where_they_did(name: str) -> None:
    result = replay_file(FOLDER / f"{name}.pcapng")
    assert not result.damage
    found, golden = parting(result), ELSEWHERE[name]
    assert found["compared"] == golden["compared"]
    assert found["states"] == golden["states"]
    assert found["largest"] == pytest.approx(golden["largest"], rel=0.01, abs=1e-7)


@needs_captures
@pytest.mark.parametrize("name", [name for name in sorted(ELSEWHERE) if "joint-sine" in name])
def test_an_emulator_beside_a_joint_sine_moves_like_the_recorded_arm(name: str) -> None:
    """The recorded controller followed at once; ours is an arm with mass: what is left is how it follows."""
    largest = ELSEWHERE[name]["largest"]
    assert largest["A4 measured"] < 1e-3
    recorded, emulated = (
        [state for whose, _, state in ELSEWHERE[name]["states"] if whose == side] for side in ("recording", "emulator")
    )
    assert recorded == emulated
