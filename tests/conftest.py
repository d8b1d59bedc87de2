"""Settings of all tests: property tests draw the same cases every time, and no case fails for being slow."""

from hypothesis import settings

from hil.arithmetic import fix_arithmetic

fix_arithmetic()

settings.register_profile("repeatable", derandomize=True, deadline=None, print_blob=True)
settings.load_profile("repeatable")
