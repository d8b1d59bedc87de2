"""``--json FILE|-``: what was found, for programs."""

import sys
from pathlib import Path

from hil.runtime.lifetime import check_result_file, result_text, write_result_file


class JsonOutput:
    """Where a result goes as JSON, if anywhere; checked before anything is measured."""

    def __init__(self, json_file: str | None) -> None:
        self.alone = json_file == "-"
        """Whether the output is JSON and nothing else."""
        self._file = None if self.alone or json_file is None else Path(json_file)
        check_result_file(self._file)

    def write(self, result: object) -> None:
        """Write it."""
        if self.alone:
            sys.stdout.write(result_text(result))
        write_result_file(self._file, result)
