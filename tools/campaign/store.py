"""What a campaign has found so far, in a folder: rows as they come, and the table at the end.

``rows.jsonl`` is written line by line, so that a campaign that was interrupted, or whose machine went down, goes on
where it was. ``results.csv`` and ``results.parquet`` are made of it.
"""

import csv
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final, Self, TextIO

from hil.values.errors import ConfigurationError, UsageError
from tools.campaign.scenario import COLUMNS, Row, Scenario
from transport.claims import claim_file

ROWS: Final = "rows.jsonl"
CSV: Final = "results.csv"
PARQUET: Final = "results.parquet"
PICTURE: Final = "results.png"


class Store:
    """The folder of one campaign; of one campaign at a time. Raises :class:`ConfigurationError`."""

    def __init__(self, folder: Path, *, fresh: bool = False) -> None:
        self.folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._file: TextIO = (folder / ROWS).open("a+", encoding="utf-8", errors="replace")
        except OSError as error:
            raise ConfigurationError(f"cannot keep results in {folder}: {error.strerror}") from error
        try:
            self._lock()
            if fresh:
                self._file.truncate(0)
            self._rows = self._read()
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> Self:
        """Return it."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close it."""
        self._file.close()

    @property
    def rows(self) -> Mapping[str, Row]:
        """What was found, by the scenario's key."""
        return self._rows

    def has(self, scenario: Scenario, *, patience_s: float) -> bool:
        """Whether nothing new is to be expected of a scenario: it is tried again where its worker died, or was ended
        with less patience than ``patience_s``."""
        row = self._rows.get(scenario.key)
        if row is None or row["outcome"] == "worker-died":
            return False
        return row["outcome"] != "hung" or row["wall_s"] >= patience_s

    def add(self, row: Row) -> None:
        """Keep ``row``, on the disk too."""
        self._rows[row["key"]] = row
        try:
            self._file.write(json.dumps(row) + "\n")
            self._file.flush()
        except OSError as error:
            raise UsageError(
                f"cannot write {self.folder / ROWS}: {error.strerror}; what was found before is kept, and the same "
                "command goes on from there"
            ) from error

    def _lock(self) -> None:
        if holder := claim_file(self._file.fileno()):
            raise ConfigurationError(
                f"another campaign writes to {self.folder} ({holder}): wait for its end, or choose another folder "
                "with --out"
            )

    def _read(self) -> dict[str, Row]:
        self._file.seek(0)
        rows: dict[str, Row] = {}
        whole = 0
        for line in iter(self._file.readline, ""):
            row = _row_of(line)
            if row is not None:
                rows[row["key"]] = row
            if line.endswith("\n"):
                whole = self._file.tell()
        # The last line of a campaign that was killed may be a part of one.
        self._file.truncate(whole)
        self._file.seek(0, os.SEEK_END)
        return rows


def _row_of(line: str) -> Row | None:
    try:
        row = json.loads(line)
    except ValueError:
        return None
    if not isinstance(row, dict) or row.keys() != COLUMNS.keys():
        return None
    found: Row = row  # type: ignore[assignment]  # it has the keys of one
    return found


def write_csv(rows: Sequence[Row], file: Path) -> None:
    """Write the table as CSV."""
    with file.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)


def write_parquet(rows: Sequence[Row], file: Path) -> bool:
    """Write the table as Parquet; False where pyarrow is not installed."""
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        return False
    types = {str: pa.string(), int: pa.int64(), float: pa.float64()}
    schema = pa.schema(
        [
            (name, next(arrow for python, arrow in types.items() if hint in {python, python | None}))
            for name, hint in COLUMNS.items()
        ]
    )
    pq.write_table(pa.Table.from_pylist(list(rows), schema=schema), file)
    return True
