"""``hil snapshot``: robots as a picture, drawn off screen."""
