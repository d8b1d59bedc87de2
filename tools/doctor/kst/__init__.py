"""``hil doctor kst``: the KST links of a running controller, by what it says itself; nobody connects to their port.

``told`` reads what a controller's pad says, ``verdict`` makes findings and tables of it.
"""
