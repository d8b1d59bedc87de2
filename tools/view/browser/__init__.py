"""The page in the browser: robots in 3D, and the operator's pad."""
