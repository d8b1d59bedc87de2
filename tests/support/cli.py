"""The command line in this process: for what it says, where a process of its own would add nothing but its start."""

import io
import sys
from contextlib import redirect_stderr, redirect_stdout

import pytest

from hil.cli.main import main
from tests.support.processes import Ended


def cli(*arguments: object) -> Ended:
    """Run ``hil`` with these arguments and return its code and what it said."""
    out, err = io.StringIO(), io.StringIO()
    code: object = 0
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.setattr(sys, "argv", ["hil", *map(str, arguments)])
        try:
            main()
        except SystemExit as ended:
            code = ended.code
    assert code is None or isinstance(code, int)
    return Ended(code or 0, out.getvalue(), err.getvalue())
