"""A real arm beside an emulated one: what the emulator would have measured, had it been told the same."""
