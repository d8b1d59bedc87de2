"""Long runs: hours of virtual time under the safety laws, and minutes of real time with real processes."""
