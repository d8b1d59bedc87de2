"""Developer tools; nothing here runs when the emulator runs."""
