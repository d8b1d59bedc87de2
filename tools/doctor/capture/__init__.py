"""Whose fault it was, from a capture: FRI cycles, servo set points, TCP connections."""
