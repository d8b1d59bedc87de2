"""From a capture file to its page."""

import os
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from backends.robots import load_description, load_pinocchio
from hil.config.station import RobotConfig
from hil.core.controller import Controller
from hil.core.model import ArmModel
from hil.replay.exact import Observer
from hil.replay.replay import (
    ProgressTold,
    Wish,
    flows_of,
    own_header,
    records_of,
    replay_own,
    tell_why_not_own,
)
from hil.replay.result import ReplayResult
from hil.runtime.assembly import RobotParts
from hil.runtime.capture_header import CaptureHeader, RobotStart, read_header
from hil.runtime.lifetime import check_result_file
from hil.values.errors import UsageError
from hil.values.link import Address
from tools.doctor.capture.elsewhere import in_order
from tools.report.figures import figures_from_packets, figures_of
from tools.report.observer import RobotObserver
from tools.report.packets import PacketObserver
from tools.report.page import PageText, build_page
from tools.report.record import RobotRecord
from tools.report.verdict import verdict_of
from transport.capture.parts import parts_from
from transport.capture.reading import read_section_comment

_ONLY_PACKETS: Final = (
    "Not replayed: the page shows what the packets alone tell. Times are those of the recorder's clock, at the place "
    "where it recorded; reasons and margins are inside the controller and not known."
)


@dataclass(frozen=True, slots=True)
class Made:
    """What was written."""

    file: Path
    size_bytes: int
    verdict: str
    damage: str
    """Where and why the capture could not be read any further; empty where it could."""


def make_report(
    capture: Path,
    output: Path,
    *,
    wish: Wish | None = None,
    key_file: Path | None = None,
    progress: ProgressTold | None = None,
) -> Made:
    """Write the page of ``capture`` to ``output``; raise ``CaptureError`` or ``UsageError`` where there is none.

    ``wish`` says of a recording from elsewhere what its packets do not tell.
    """
    check_result_file(output)
    if output.exists() and any(output.samefile(part) for part in parts_from(capture)):
        raise UsageError(f"{output} is the capture itself; the page needs another name")
    header = own_header(capture)
    if header is not None:
        header = header if key_file is None else header.with_key(key_file)
        if wish is not None and any(wish):
            names = ", ".join(robot.model for robot in header.station.robot)
            raise UsageError(
                f"{capture} names its robot and release ({names}): --robot and --fri-version are for others"
            )
        text, robots, damage = _of_own(capture, header, progress)
    else:
        header = read_header(read_section_comment(capture))
        text, robots, damage = _from_packets(capture, header, wish or Wish(), progress)
    page = build_page(text, robots)
    _write(output, page)
    return Made(output, len(page), text.verdict.sentence, damage)


def _of_own(
    capture: Path, header: CaptureHeader, progress: ProgressTold | None
) -> tuple[PageText, list[RobotRecord], str]:
    observers: list[RobotObserver] = []

    def observe(start: RobotStart, config: RobotConfig, parts: RobotParts, controller: Controller) -> Observer:
        model = ArmModel(load_pinocchio(parts.description.name))
        observers.append(RobotObserver(start, config, parts, controller, model=model))
        return observers[-1]

    result = replay_own(capture, header, progress=progress, observe=observe)
    if not result.cycles:
        reason = f": {result.damage}" if result.damage else ""
        raise UsageError(f"{capture} holds no control cycle, so there is nothing to report{reason}")
    robots: list[RobotRecord] = []
    for observer, config in zip(observers, header.station.robot, strict=True):
        observer.finish()
        record = observer.record
        record.figures = figures_of(record, config)
        robots.append(record)
    text = PageText(
        title=f"Run {capture.name}",
        verdict=verdict_of(robots, own=True),
        source=_source(header, result),
        alarms=_alarms(result),
        notes=result.notes,
        run={"software": header.software, **header.machine},
    )
    return text, robots, result.damage


def _source(header: CaptureHeader, result: ReplayResult) -> list[str]:
    when = datetime.fromtimestamp(header.robots[0].unix_epoch_ns // 10**9, UTC)
    told = (
        f"Recorded by {header.software} from {when:%Y-%m-%d %H:%M:%S} UTC on: {result.recorded_s:.3f} s, "
        f"{result.cycles} control cycles."
    )
    if result.equal:
        told += (
            f" Replayed through a fresh controller, all {result.compared} of its datagrams identical to the byte: what "
            f"is inside the controller is known."
        )
    return [told]


def _alarms(result: ReplayResult) -> list[str]:
    alarms = []
    if result.damage:
        alarms.append(f"The file is damaged; what is before the damage is shown. {result.damage}")
    if not result.alike:
        alarms.append(
            f"This page is not what happened to the last digit: the replay it is made of is not identical with the "
            f"recording. {result.verdict}"
        )
    elif not result.compared:
        alarms.append("The controller sent nothing in this recording, so nothing proves that the replay is identical.")
    if not result.complete and not result.damage:
        alarms.append("The recording was not ended in order: its process was killed, or the disk was full.")
    return alarms


def _from_packets(
    capture: Path, header: CaptureHeader | None, wish: Wish, progress: ProgressTold | None
) -> tuple[PageText, list[RobotRecord], str]:
    result = ReplayResult(str(capture), own=False)
    if header is not None:
        tell_why_not_own(header, capture, result)
    flows = flows_of(capture, wish)
    observers: dict[tuple[Address, Address], PacketObserver] = {}
    first_unix_ns = min((flow.first_unix_ns for flow in flows.values()), default=0)
    for flow in flows.values():
        name, model = _name_and_model(header, flow.controller, alone=len(flows) == 1)
        model = wish.model or model
        load_description(model)
        arm = ArmModel(load_pinocchio(model))
        observers[flow.controller, flow.client] = PacketObserver(
            flow, name=name, model_name=model, model=arm, first_unix_ns=first_unix_ns
        )
    records = records_of(parts_from(capture), result, progress)
    for packet in in_order(records):
        source, destination = Address(*packet.source), Address(*packet.destination)
        if (sender := observers.get((source, destination))) is not None:
            sender.sent(packet)
        elif (receiver := observers.get((destination, source))) is not None:
            receiver.answered(packet)
        else:
            result.strangers += 1
    if not observers:
        raise UsageError(_nothing_in(capture, header, result))
    robots: list[RobotRecord] = []
    for observer in observers.values():
        observer.finish()
        observer.record.figures = figures_from_packets(observer)
        robots.append(observer.record)
    if result.strangers:
        result.note(f"{result.strangers} datagrams are not between a controller and its FRI client")
    length_s = max(robot.end_s for robot in robots)
    text = PageText(
        title=f"Capture {capture.name}",
        verdict=verdict_of(robots, own=False),
        source=[f"{length_s:.3f} s. {_ONLY_PACKETS}"],
        alarms=[f"The file is damaged; what is before the damage is shown. {result.damage}"] if result.damage else [],
        notes=result.notes,
    )
    return text, robots, result.damage


def _name_and_model(header: CaptureHeader | None, controller: Address, *, alone: bool) -> tuple[str, str]:
    for start, config in zip(header.robots if header else (), header.station.robot if header else (), strict=False):
        if controller in (start.address(link) for link in start.bound):
            return start.name, config.model
    return "arm" if alone else f"arm at {controller}", RobotConfig().model


def _nothing_in(capture: Path, header: CaptureHeader | None, result: ReplayResult) -> str:
    if result.damage:
        return f"nothing to report before the damage: {result.damage}"
    if header is not None and any(robot.servo is not None for robot in header.station.robot):
        return f"{capture} holds no FRI session, and the servo link needs the whole recording: {result.notes[0]}"
    return f"{capture} holds no FRI session and no servo link ({result.strangers} other datagrams): nothing to report"


def _write(output: Path, page: bytes) -> None:
    """Write the whole page or nothing."""
    beside = output.with_name(f".{output.name}.{os.getpid()}.new")
    try:
        beside.write_bytes(page)
        beside.replace(output)
    finally:
        with suppress(OSError):
            beside.unlink(missing_ok=True)
