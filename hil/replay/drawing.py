"""Recorded and emulated positions of the arm over time, and their difference, as a picture."""

from pathlib import Path
from typing import Final

from hil.replay.result import ReplayResult
from hil.runtime.lifetime import check_result_file
from hil.values.errors import ConfigurationError
from hil.values.fri_messages import MonitoringMessage
from hil.values.robot import JOINT_COUNT, JOINT_NAMES
from hil.values.servo import State

_MOST_POINTS: Final = 4000
_SUFFIXES: Final = (".png", ".svg", ".pdf")


class Drawing:
    """Takes pairs of messages of the first robot, thinned where there are many; ``save`` draws them."""

    def __init__(self, file: Path) -> None:
        check_result_file(file)
        if file.suffix not in _SUFFIXES:
            raise ConfigurationError(f"cannot draw {file}; valid endings: {', '.join(_SUFFIXES)}")
        self._file = file
        self._robot: str | None = None
        self._every = 1
        self._seen = 0
        self._points: list[tuple[float, tuple[float, ...], tuple[float, ...]]] = []

    def wants(self, robot: str) -> bool:
        """Whether the next pair of ``robot`` is drawn; asked once for each."""
        if self._robot is None:
            self._robot = robot
        if robot != self._robot:
            return False
        self._seen += 1
        return self._seen % self._every == 0

    def pair(self, t_s: float, recorded: object, emulated: object) -> None:
        """Take a recorded message and the emulator's."""
        one, other = _measured(recorded), _measured(emulated)
        if one is None or other is None:
            return
        self._points.append((t_s, one, other))
        if len(self._points) >= _MOST_POINTS:
            self._points = self._points[::2]
            self._every *= 2

    def save(self, result: ReplayResult) -> None:
        """Write the picture."""
        import matplotlib as mpl

        mpl.use("Agg")
        from matplotlib import pyplot as plt

        figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(10, 7), height_ratios=(2, 1))
        times = [t_s for t_s, _, _ in self._points]
        for joint in range(JOINT_COUNT):
            recorded = [one[joint] for _, one, _ in self._points]
            emulated = [other[joint] for _, _, other in self._points]
            (line,) = above.plot(times, recorded, label=JOINT_NAMES[joint])
            above.plot(times, emulated, linestyle=":", color="black", linewidth=1)
            off = [1e3 * (b - a) for a, b in zip(recorded, emulated, strict=True)]
            below.plot(times, off, color=line.get_color(), linewidth=1)
        for _, whose, t_s, state in result.states:
            if whose == "recording":
                above.axvline(t_s, color="grey", linewidth=0.5)
                above.annotate(state, (t_s, 0.02), xycoords=("data", "axes fraction"), rotation=90, fontsize=6)
        above.set_ylabel("measured position, rad\n(dotted: emulator)")
        above.legend(ncols=JOINT_COUNT, fontsize=8, loc="lower center", bbox_to_anchor=(0.5, 1.0))
        below.set_ylabel("emulator minus\nrecording, mrad")
        below.set_xlabel("time of the recording, s")
        figure.suptitle(Path(result.file).name)
        figure.tight_layout()
        try:
            figure.savefig(self._file, dpi=110)
        except (OSError, ValueError) as error:
            raise ConfigurationError(f"cannot write {self._file}: {error}") from error
        finally:
            plt.close(figure)


def _measured(message: object) -> tuple[float, ...] | None:
    if isinstance(message, MonitoringMessage):
        position = None if message.monitor is None else message.monitor.measured_position
    elif isinstance(message, State):
        position = message.snapshot.measured_position
    else:
        return None
    return position if position is not None and len(position) == JOINT_COUNT else None
