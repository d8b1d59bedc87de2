"""Control laws: set point and measured state in, seven actuation torques out, once a cycle. See ``law.ControlLaw``."""
