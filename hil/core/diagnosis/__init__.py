"""What the controller recognises while it runs: whose fault it was, in one sentence."""
