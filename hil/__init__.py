"""fri-hil: an open controller emulator for KUKA's light-weight arms."""
