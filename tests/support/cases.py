"""How many cases a property test draws: few where everything is tested, many where there is time for them.

HIL_PROPERTY_SCALE is the factor; ``make soak`` sets it. With it other cases are drawn each time.
"""

import os
from typing import Final

SCALE: Final = int(os.environ.get("HIL_PROPERTY_SCALE", "1"))


def cases(number: int) -> int:
    """Return how many cases to draw where ``number`` are drawn by ``make test``."""
    return number * SCALE
