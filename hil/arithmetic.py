"""The same sums on every machine: what a recording needs to replay to the last bit elsewhere.

Addition of floats depends on its order. The BLAS that numpy brings along chooses its routines by the processor, so the
command line chooses for it, before numpy is imported: the routines that every x86-64 processor since 2013 has. What
remains is the C library (sine, cosine and the like), which the fingerprint tells.
"""

import os
import zlib
from typing import Final

_ROUTINES: Final = {"x86_64": "Haswell"}
"""By machine, as ``uname`` calls it; on others the BLAS chooses."""
_SAMPLES: Final = 64


def fix_arithmetic() -> None:
    """Let BLAS take the same routines on every machine; works only before numpy is imported."""
    routines = _ROUTINES.get(os.uname().machine)
    if routines is not None:
        os.environ.setdefault("OPENBLAS_CORETYPE", routines)
    # With one thread nothing depends on how work is divided, and seven by seven numbers need no second one.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def arithmetic_fingerprint() -> str:
    """Return eight digits that are the same where C library, BLAS and numpy give the same last bits."""
    import math
    import random

    import numpy as np

    source = random.Random(1)  # noqa: S311  # the same numbers every time are the point
    numbers = [source.uniform(-3.0, 3.0) for _ in range(7 * _SAMPLES)]
    scalars = [f(number) for number in numbers for f in (math.sin, math.cos, math.exp, math.atan, math.tanh)]
    matrix = np.array(numbers).reshape(_SAMPLES, 7)
    table = matrix.T.dot(matrix)
    products = [table, table.dot(table), np.linalg.solve(table, matrix[0]), np.tanh(matrix), matrix[:7].dot(matrix[7])]
    crc32 = zlib.crc32(np.array(scalars).tobytes())
    for product in products:
        crc32 = zlib.crc32(np.ascontiguousarray(product).tobytes(), crc32)
    return f"{crc32:08x}"
