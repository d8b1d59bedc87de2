"""What leaves and enters the process: wire formats and recordings. Imports nothing of ours but `hil.values`."""
