"""``hil doctor tcp``: small messages over TCP, and which side makes them wait."""
