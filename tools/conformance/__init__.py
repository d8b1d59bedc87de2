"""Robot sides on the bench: what lives behind each backend, and how two of them differ."""
