"""CoppeliaSim, the successor of V-REP PRO, as a renderer of robots (manual 3.2, 5.6 and 6).

Spoken to through its ZeroMQ remote API, so nothing has to be copied into its folders (manual 5.6.1). The real simulator
was not available to the tests: they speak to a stand-in that knows the same protocol.
"""

from tools.view.coppelia.link import DEFAULT_ADDRESS
from tools.view.coppelia.renderer import CoppeliaSim

__all__ = ["DEFAULT_ADDRESS", "CoppeliaSim"]
