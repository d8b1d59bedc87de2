"""A recording as one page that opens without a network: what happened, when, and whose fault it was."""
