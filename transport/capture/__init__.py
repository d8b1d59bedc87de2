"""Recording and reading of UDP datagrams as pcapng files.

``records`` is the value, ``pcapng`` the file format, ``process`` the recorder a control loop may call.
``segments`` reads the TCP segments that other programs recorded.
Nothing is imported here: the recorder's parent needs no file format, and its child should start fast.
"""
