"""Monitors between the interpolator and the arm."""
