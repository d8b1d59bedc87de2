"""Application processes; they import :mod:`hil.client` and nothing else of the project."""
