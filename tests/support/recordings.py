"""Recordings made in virtual time, and what can be done to them."""

from collections.abc import Callable, Iterator
from pathlib import Path

from hil.config.station import FriConfig, RobotConfig, ServoConfig
from hil.runtime.capture_header import CaptureHeader, read_header
from hil.values.fri import Release
from tools.bench.clients import BenchMotion, recorded_client
from tools.bench.recording import VirtualRun
from transport.capture.reading import read_records, read_section_comment
from transport.capture.records import CapturedDatagram, CaptureRecord, Notes, Packet
from transport.capture.writing import PcapngWriter


def fri_robot(release: Release = Release.V1_15, **more: object) -> RobotConfig:
    """A robot with an FRI link and nothing else; ideal unless told otherwise."""
    fri = {"release": release, **more.pop("fri", {})}  # type: ignore[dict-item]
    return RobotConfig.model_validate({"backend": "ideal", "fri": FriConfig.model_validate(fri), **more})


def servo_robot(**more: object) -> RobotConfig:
    """A robot with a servo link and nothing else."""
    return RobotConfig.model_validate({"backend": "ideal", "servo": ServoConfig(), **more})


def motion_of(config: RobotConfig) -> BenchMotion:
    """What moves such a robot."""
    return BenchMotion.FRI_OVERLAY if config.fri is not None else BenchMotion.SMART_SERVO


def record(
    file: Path,
    config: RobotConfig,
    seconds: float,
    *,
    during: Callable[[VirtualRun], None] | None = None,
    motion: BenchMotion | None = None,
    seed: int = 1,
) -> Path:
    """Record a run of ``seconds``, then what ``during`` does, then its end."""
    run = VirtualRun(config, recorded_client(config, motion or motion_of(config)), file, seed=seed)
    run.run(seconds)
    if during is not None:
        during(run)
    run.close()
    return file


def records(file: Path) -> list[CaptureRecord]:
    """Everything in a recording."""
    return list(read_records(file))


def packets(file: Path) -> list[Packet]:
    """Its datagrams."""
    return [one for one in records(file) if isinstance(one, Packet)]


def header_of(file: Path) -> CaptureHeader:
    """What it says of its run."""
    header = read_header(read_section_comment(file))
    assert header is not None
    return header


def rewrite(
    file: Path,
    change: Callable[[CaptureRecord], Iterator[CaptureRecord | CapturedDatagram]],
    *,
    comment: str | None = None,
) -> Path:
    """Write a recording anew with every record changed, as a program that knows the format would; checksums fit."""
    found = records(file)
    with PcapngWriter(file, comment=comment or read_section_comment(file)) as writer:
        for record_ in found:
            for one in change(record_):
                if isinstance(one, Notes):
                    writer.note(one.entries)
                else:
                    writer.write(one.datagram if isinstance(one, Packet) else one)
    return file


def flip_bit(file: Path, packet: Packet, byte: int, bit: int) -> None:
    """Change one bit of a datagram's payload in the file itself."""
    content = bytearray(file.read_bytes())
    at = content.index(packet.payload, packet.offset) + byte
    content[at] ^= 1 << bit
    file.write_bytes(content)
