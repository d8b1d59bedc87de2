"""SmartServo under impedance control (manual 8.1.3): ``python -m apps.smart_servo_interaction_control``.

Validates the load, begins under soft Cartesian impedance, becomes stiffer while it runs and somebody pushes, and ends
under joint impedance, which needs a motion of its own.
"""

import typer

from apps._interaction_sample import interaction_app
from hil.client.servo import SmartServo

main = interaction_app("smart_servo_interaction_control", SmartServo)

if __name__ == "__main__":
    typer.run(main)
