"""Motions: what the interpolator does. Each is ``interpolate() -> SetPoint`` once a control cycle."""
