"""The command line: ``hil run | demo | bench | config``."""
