"""Slow patterns in captured TCP connections: who waits for whom, decided from the packets.

``direction`` is what one side sends and the other acknowledges, ``connection`` the two of them and their exchanges,
``connections`` all of a capture in bounded memory, ``verdict`` the sentences, ``diagnose`` the way in.
"""
