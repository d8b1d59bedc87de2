"""Distributions with backends, as an installer would have left them: metadata and a module, in a folder of a test."""

import sys
from pathlib import Path

import pytest


def offer(
    patch: pytest.MonkeyPatch, folder: Path, *, distribution: str, version: str = "1.0", backends: dict[str, str],
    module: str = "", source: str = "",
) -> None:  # fmt: skip
    """Let ``distribution`` offer ``backends`` (entry points by name), with a module of that source."""
    metadata = folder / f"{distribution.replace('-', '_')}-{version}.dist-info"
    metadata.mkdir(parents=True)
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {distribution}\nVersion: {version}\n")
    points = "".join(f"{name} = {target}\n" for name, target in backends.items())
    (metadata / "entry_points.txt").write_text(f"[hil.backends]\n{points}")
    if module:
        (folder / f"{module}.py").write_text(source)
    if str(folder) not in sys.path:
        patch.syspath_prepend(str(folder))
