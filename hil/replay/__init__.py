"""Captures of a run, played again: through a fresh controller, or as one side of a live conversation."""
