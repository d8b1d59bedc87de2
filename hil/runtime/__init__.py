"""The asyncio shell around the core: clock, pacing, sockets, signals, capture. The only part that knows real time."""
