"""Numbers as a Java program prints and reads them."""

import math
import re
from decimal import Decimal
from typing import Final

_LEAST_PLAIN: Final = 1e-3
_MOST_PLAIN: Final = 1e7
"""From the one to below the other a number is printed without an exponent."""
# The grammar of Double.valueOf. Python's own float() takes "nan", "inf" and "1_000" too, which Java refuses.
_DECIMAL: Final = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?[fFdD]?", re.ASCII)
_HEXADECIMAL: Final = re.compile(r"([+-]?)0[xX]([0-9a-fA-F]*\.?[0-9a-fA-F]*)[pP]([+-]?\d+)[fFdD]?", re.ASCII)
_NAMED: Final = {
    "NaN": math.nan,
    "+NaN": math.nan,
    "-NaN": math.nan,
    "Infinity": math.inf,
    "+Infinity": math.inf,
    "-Infinity": -math.inf,
}
_DIGITS_MOST: Final = 400
"""Of an exponent or a mantissa: more are no number a program prints."""


def java_text(number: float) -> str:
    """Return ``number`` as ``Double.toString`` prints it: the fewest digits that read back as the same number.

    Java before 19 printed a digit too many for a few numbers (2.0E-3 among them in the oldest); those are not copied.
    """
    if math.isnan(number):
        return "NaN"
    if math.isinf(number):
        return "Infinity" if number > 0.0 else "-Infinity"
    if number == 0.0 or _LEAST_PLAIN <= abs(number) < _MOST_PLAIN:
        # Python changes to an exponent later than Java, above and below.
        return repr(number)
    shortest = Decimal(repr(number)).normalize()
    # Java has two digits at least, the nearest ones: 4.9E-324 where Python has 5e-324.
    text = f"{shortest:e}" if len(shortest.as_tuple().digits) > 1 else f"{number:.1e}"
    mantissa, _, exponent = text.partition("e")
    return f"{mantissa}E{int(exponent)}"


def java_double(text: str) -> float:
    """Return the number ``Double.parseDouble`` reads in ``text``; raise ValueError where that throws."""
    trimmed = text.strip(_BLANKS)
    if len(trimmed) > _DIGITS_MOST:
        raise ValueError(f"{len(trimmed)} characters are no number")
    if trimmed in _NAMED:
        return _NAMED[trimmed]
    if _DECIMAL.fullmatch(trimmed):
        return float(trimmed.rstrip("fFdD"))
    hexadecimal = _HEXADECIMAL.fullmatch(trimmed)
    if hexadecimal and hexadecimal[2] not in ("", "."):
        try:
            return float.fromhex(f"{hexadecimal[1]}0x{hexadecimal[2]}p{hexadecimal[3]}")
        except OverflowError:
            return -math.inf if hexadecimal[1] == "-" else math.inf
    raise ValueError(f"{text!r} is no number")


_BLANKS: Final = "".join(map(chr, range(0x21)))
"""What Java's trim() takes off both ends."""
