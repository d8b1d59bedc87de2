"""``hil step-response``: the manual's section 7.12 on our arm.

From the start pose each axis alone is sent one step; the same step under SmartServo with its defaults, SmartServo fast
(``set_joint_jerk(500)``, ``override_joint_acceleration(20)``) and DirectServo. A controller, a session of the servo
link and the arm are joined in virtual time, so a run repeats to the bit.

- ``figures_of_merit``: what a recorded step is worth, in numbers. Pure.
- ``measuring``: the steps themselves.
- ``report``: table, JSON, and the manual's statements held against the figures.
- ``drawing``: the pictures.
"""
