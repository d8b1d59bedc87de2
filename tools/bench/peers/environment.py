"""The environment of the peers: where it is, and what is in it."""

import json
import subprocess
from pathlib import Path
from typing import Final

from hil.values.errors import ConfigurationError

FOLDER: Final = Path(__file__).resolve().parents[3] / ".venv-peers"
"""Where ``make bench-peers`` makes it."""
_LIBRARIES: Final = ("franky-sim", "mujoco", "pin", "numpy")
_VERSIONS: Final = (
    "import importlib.metadata as found, json, platform, sys; "
    "print(json.dumps({'python': platform.python_version(), **{name: found.version(name) for name in sys.argv[1:]}}))"
)


class PeerEnvironment:
    """A virtual environment with the peers in it; raises :class:`ConfigurationError` where there is none."""

    def __init__(self, folder: Path = FOLDER) -> None:
        self.python = folder / "bin" / "python"
        self.franky_sim = folder / "bin" / "franky-sim"
        if not self.franky_sim.exists():
            raise ConfigurationError(
                f"{folder} has no franky-sim: `make bench-peers` makes that environment with the versions of "
                "tools/bench/peers/constraints.txt"
            )

    def versions(self) -> dict[str, str]:
        """Return the versions of Python and of what matters there."""
        said = subprocess.run(
            [self.python, "-c", _VERSIONS, *_LIBRARIES], check=True, capture_output=True, text=True, timeout=60.0
        )
        found: dict[str, str] = json.loads(said.stdout)
        return found
