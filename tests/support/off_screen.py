"""Whether a picture can be drawn here at all, for tests that draw one."""

from hil.values.errors import ConfigurationError
from tools.snapshot.opengl import drawing_surface


def no_picture_here() -> str:
    """Return why no picture can be drawn without a screen; empty where one can."""
    try:
        with drawing_surface(16, 16):
            return ""
    except ConfigurationError as error:
        return str(error)
