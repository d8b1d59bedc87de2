"""What pushes the arm, from what its joint torque sensors show: joint torques, and force and moment at the flange."""
