"""DirectServo under impedance control (manual 8.2.3): ``python -m apps.direct_servo_interaction_control``.

Validates the load, begins under soft Cartesian impedance, becomes stiffer while it runs and somebody pushes, and ends
under joint impedance, which needs a motion of its own.
"""

import typer

from apps._interaction_sample import interaction_app
from hil.client.servo import DirectServo

main = interaction_app("direct_servo_interaction_control", DirectServo)

if __name__ == "__main__":
    typer.run(main)
