"""Benchmarks behind ``hil bench``: figures with the machine they were measured on, and the bounds beside them."""
