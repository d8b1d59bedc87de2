"""The sans-I/O core: bytes and times go in, bytes and events come out. No clock, no socket, no thread, no simulator."""
