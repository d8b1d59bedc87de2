"""Settings of all tests: property tests draw the same cases every time, and no case fails for being slow."""

from hypothesis import settings

from hil.arithmetic import fix_arithmetic
from tests.support.cases import SCALE, cases

fix_arithmetic()

settings.register_profile("repeatable", max_examples=cases(60), derandomize=SCALE == 1, deadline=None, print_blob=True)
settings.load_profile("repeatable")
