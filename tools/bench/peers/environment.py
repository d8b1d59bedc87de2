"""The environments of the peers, one each, because they need different versions of the same libraries."""

import json
import subprocess
from pathlib import Path
from typing import Final, NamedTuple

from hil.values.errors import ConfigurationError

FOLDER: Final = Path(__file__).resolve().parents[3] / ".venv-peers"
"""Where ``make bench-peers`` makes them."""
FRANKY: Final = "franky-sim"
FRANKA: Final = "franka-sim"
_VERSIONS: Final = (
    "import importlib.metadata as found, json, platform, sys; "
    "print(json.dumps({'python': platform.python_version(), **{name: found.version(name) for name in sys.argv[1:]}}))"
)


class _Known(NamedTuple):
    program: str
    libraries: tuple[str, ...]


_KNOWN: Final = {
    FRANKY: _Known("franky-sim", (FRANKY, "mujoco", "pin", "numpy")),
    FRANKA: _Known("run-franka-sim-server", (FRANKA, "mujoco", "numpy")),
}
PEERS: Final = tuple(_KNOWN)
_ARM: Final = "lib/python3*/site-packages/franky_sim/assets/fr3.xml"
_MESHES: Final = ('meshdir="assets"', 'meshdir="{}/meshes"')


class PeerEnvironment:
    """The virtual environment of one peer; raises :class:`ConfigurationError` where there is none."""

    def __init__(self, folder: Path, peer: str) -> None:
        self._folder = folder / peer
        self._libraries = _KNOWN[peer].libraries
        self.python = self._folder / "bin" / "python"
        self.program = self._folder / "bin" / _KNOWN[peer].program
        """What starts it as a server."""
        if not self.program.exists():
            raise ConfigurationError(
                f"{self._folder} has no {peer}: `make bench-peers` makes that environment with the versions of "
                f"tools/bench/peers/{peer}.txt"
            )

    def versions(self) -> dict[str, str]:
        """Return the versions of Python and of what matters there."""
        said = subprocess.run(
            [self.python, "-c", _VERSIONS, *self._libraries], check=True, capture_output=True, text=True, timeout=60.0
        )
        found: dict[str, str] = json.loads(said.stdout)
        return found

    def arm(self) -> str:
        """Return the model that franky-sim brings along, with the place of its meshes filled in."""
        found = sorted(self._folder.glob(_ARM))
        if not found:
            raise ConfigurationError(f"{self._folder} has no {_ARM}: make that environment again")
        placeholder, place = _MESHES
        return found[0].read_text(encoding="utf-8").replace(placeholder, place.format(found[0].parent))


def environments(folder: Path = FOLDER) -> dict[str, PeerEnvironment]:
    """Return the environment of each peer; raise :class:`ConfigurationError` if one is missing."""
    return {peer: PeerEnvironment(folder, peer) for peer in PEERS}
