"""Named tuples in half the time, for the ten that are made in every control cycle and nowhere else.

The constructor of a ``NamedTuple`` is a Python function that packs its arguments and calls :data:`new_tuple`; here the
caller packs them, all of them, in order. It costs 0.1 us instead of 0.2 us and checks nothing.
"""

from typing import Final

new_tuple: Final = tuple.__new__
"""``new_tuple(SomeNamedTuple, (every, field, in, order))``."""
