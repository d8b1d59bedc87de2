"""What a figure was measured on."""

import os
import platform
from importlib.metadata import version
from pathlib import Path

_LIBRARIES = ("fri-hil", "mujoco", "pin", "numpy", "protobuf", "ruckig")


def machine() -> dict[str, str]:
    """Return processor, cores, system, Python and library versions."""
    return {
        "processor": _processor(),
        "cores": str(len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()),
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
        **{name: version(name) for name in _LIBRARIES},
    }


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.machine())
