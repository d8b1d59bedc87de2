"""Where two backends differ on the same command stream, and the rigs they stand on."""
