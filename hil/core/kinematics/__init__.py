"""Kinematics in closed form: poses, the S-R-S arm forward and inverse, its singularities, its redundancy."""
