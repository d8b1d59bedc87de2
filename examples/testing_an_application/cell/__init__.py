"""Programs of a small cell with a light-weight arm."""
