"""Diagnoses: of a TCP connection, a UDP link, this host, a capture."""
