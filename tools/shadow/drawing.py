"""Both arms over time, as a picture: positions and torques, and their differences below."""

from pathlib import Path
from typing import Final

from hil.runtime.lifetime import check_result_file
from hil.values.errors import ConfigurationError
from hil.values.robot import JOINT_COUNT, JOINT_NAMES
from tools.shadow.comparison import QUANTITIES, UNITS, ShadowComparison

_SUFFIXES: Final = (".png", ".svg", ".pdf")


def check_picture(file: Path) -> None:
    """Raise :class:`ConfigurationError` now where no picture could be written at the end."""
    check_result_file(file)
    if file.suffix not in _SUFFIXES:
        raise ConfigurationError(f"cannot draw {file}; valid endings: {', '.join(_SUFFIXES)}")


def draw(comparison: ShadowComparison, file: Path, *, title: str) -> None:
    """Write the picture."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, rows = plt.subplots(2, len(QUANTITIES), sharex=True, figsize=(16, 7), height_ratios=(2, 1), squeeze=False)
    times = [point.at_s for point in comparison.points]
    for place, what in enumerate(QUANTITIES):
        above, below = rows[0][place], rows[1][place]
        for joint in range(JOINT_COUNT):
            real = [point.real[place][joint] for point in comparison.points]
            emulated = [point.emulated[place][joint] for point in comparison.points]
            (line,) = above.plot(times, real, label=JOINT_NAMES[joint], linewidth=1)
            above.plot(times, emulated, linestyle=":", color="black", linewidth=1)
            off = [b - a for a, b in zip(real, emulated, strict=True)]
            below.plot(times, off, color=line.get_color(), linewidth=1)
        above.set_title(f"{what}, {UNITS[what]} (dotted: emulated)", fontsize=9)
        below.set_title("emulated minus real", fontsize=9)
        below.set_xlabel("time, s")
    rows[0][0].legend(ncols=JOINT_COUNT, fontsize=7)
    figure.suptitle(title)
    figure.tight_layout()
    try:
        figure.savefig(file, dpi=110)
    except (OSError, ValueError) as error:
        raise ConfigurationError(f"cannot write {file}: {error}") from error
    finally:
        plt.close(figure)
