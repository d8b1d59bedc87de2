"""Fuzz targets for everything that outsiders' bytes reach: ``make fuzz SECONDS=n``."""
