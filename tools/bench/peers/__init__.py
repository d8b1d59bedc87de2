"""``hil bench peers``: other simulators of arms, measured in the same run and on the same work as this one.

A peer has an environment of its own (``make bench-peers`` makes it): its dependencies are none of ours, and ours are
none of its.
"""
