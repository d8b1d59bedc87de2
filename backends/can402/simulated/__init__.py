"""Simulated CiA 402 drives that speak the same objects, on python-can's virtual bus or a real one."""

from pathlib import Path

from backends.can402.simulated.drive import DriveFault, SimulatedDrive
from backends.can402.simulated.drives import SimulatedDrives

EDS = Path(__file__).with_name("drive402.eds")
"""What these drives are."""

__all__ = ["EDS", "DriveFault", "SimulatedDrive", "SimulatedDrives"]
