"""The two registry keys of manual 11.1, read where there is a registry. Tested with a fake one, not run on Windows."""

import socket
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Protocol

from hil.values.finding import Diagnosis, Finding, Severity, Whose
from tools.doctor.tcp.remedies import ACK_FREQUENCY_KEY, KEY_TYPE, KEY_VALUE, NO_DELAY_KEY, REGISTRY_PATH

REG_DWORD = 4
"""winreg's number of the type."""
_HIVE = "HKEY_LOCAL_MACHINE\\"
_ADDRESSES = ("IPAddress", "DhcpIPAddress")


class Registry(Protocol):
    """What of a registry is needed: the adapters' folders, and the values in each."""

    def adapters(self) -> Iterable[str]:
        """Return the names of the folders under :data:`REGISTRY_PATH`."""

    def values(self, adapter: str) -> Mapping[str, tuple[object, int]]:
        """Return (value, type) of all entries of a folder, names as they are written."""


@dataclass(frozen=True, slots=True)
class AdapterKeys:
    """What an adapter's folder has."""

    adapter: str
    problems: tuple[str, ...]
    """One for each key that is not as the manual wants it."""


def read_keys(registry: Registry, address: str) -> AdapterKeys | None:
    """Return the keys of the adapter that has the IP ``address``; None where no adapter has it."""
    for adapter in registry.adapters():
        values = registry.values(adapter)
        if any(address in _texts(values.get(name)) for name in _ADDRESSES):
            problems = (_problem(values, key) for key in (ACK_FREQUENCY_KEY, NO_DELAY_KEY))
            return AdapterKeys(adapter, tuple(problem for problem in problems if problem))
    return None


def registry_finding(registry: Registry, address: str) -> Finding:
    """Return what the registry says of the adapter with the IP ``address``."""
    try:
        keys = read_keys(registry, address)
    except OSError as error:
        return _finding("registry-unread", f"the registry under {REGISTRY_PATH} cannot be read: {error}")
    if keys is None:
        return _finding("registry-no-adapter", f"no adapter under {REGISTRY_PATH} has this side's address {address}")
    where = f"{REGISTRY_PATH}\\{keys.adapter}"
    if not keys.problems:
        return _finding(
            "registry-set",
            f"the registry has {ACK_FREQUENCY_KEY} and {NO_DELAY_KEY} for this side's adapter ({address}), as manual "
            "11.1 wants it; they count after a reboot",
        )
    found = _finding("registry-not-set", f"{where}: {'; '.join(keys.problems)}")
    return replace(
        found,
        remedies=(
            (
                f"create {ACK_FREQUENCY_KEY} and {NO_DELAY_KEY} there ({KEY_TYPE}, value {KEY_VALUE}; upper and lower "
                "case as written), as an administrator, then reboot (manual 11.1)"
            ),
        ),
    )


def with_registry(diagnosis: Diagnosis, *, towards: str) -> Diagnosis:
    """Return it with what the registry says, on Windows; ``towards``: the peer's host."""
    registry = windows_registry()
    if registry is None:
        return diagnosis
    finding = registry_finding(registry, _own_address(towards))
    return replace(diagnosis, findings=(*diagnosis.findings, finding))


def windows_registry() -> Registry | None:
    """Return this machine's registry; None where it is no Windows."""
    if sys.platform == "win32":
        import winreg

        path = REGISTRY_PATH.removeprefix(_HIVE)

        class WindowsRegistry:
            def adapters(self) -> Iterable[str]:
                with winreg.OpenKey(winreg.HKEY_LOCAL_MACHINE, path) as folder:
                    return [winreg.EnumKey(folder, number) for number in range(winreg.QueryInfoKey(folder)[0])]

            def values(self, adapter: str) -> Mapping[str, tuple[object, int]]:
                with winreg.OpenKey(winreg.HKEY_LOCAL_MACHINE, f"{path}\\{adapter}") as folder:
                    entries = [winreg.EnumValue(folder, number) for number in range(winreg.QueryInfoKey(folder)[1])]
                return {name: (value, kind) for name, value, kind in entries}

        return WindowsRegistry()

    return None


def _own_address(towards: str) -> str:
    """Return this side's address on the way there; nothing is sent."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.connect((towards, 9))
        address: str = sock.getsockname()[0]
        return address


def _texts(entry: tuple[object, int] | None) -> tuple[str, ...]:
    if entry is None:
        return ()
    value = entry[0]
    return tuple(map(str, value)) if isinstance(value, list | tuple) else (str(value),)


def _problem(values: Mapping[str, tuple[object, int]], key: str) -> str | None:
    if key not in values:
        other = next((name for name in values if name.lower() == key.lower()), None)
        return f"there is no {key}" if other is None else f"{other} is there, but its name must be written {key}"
    value, kind = values[key]
    if kind != REG_DWORD:
        return f"{key} is no {KEY_TYPE}"
    return None if value == KEY_VALUE else f"{key} is {value!r}, it must be {KEY_VALUE}"


def _finding(kind: str, sentence: str) -> Finding:
    return Finding(kind=kind, severity=Severity.NOTE, whose=Whose.CONFIGURATION, sentence=sentence)
