-- Wireshark's dissector of KUKA's Fast Robot Interface and of fri-hil's servo link.
-- Written by tools/make_dissector.py (make dissector); do not edit. How to use it: README.md beside it.

-- Loaded twice (as a plugin and by -X lua_script) it would be refused with an error.
if _G.fri_hil_dissector then return end
_G.fri_hil_dissector = true

local FRI_MONITORING_IDENTIFIER = 0x245142
local FRI_COMMAND_IDENTIFIER = 0x34001
local FRI_PORTS, SERVO_PORTS = "30200-30209", "30300"
local SERVO_BARE, SERVO_TAGGED = 0x53, 0x54
local SERVO_TAG_BYTES, SERVO_VERSION = 16, 3

local FRI_MONITORING = {
  required = {1},
  fields = {
    [1] = {name = "header", path = "fri.header", label = "Header", kind = "message", message = {
      required = {1, 2, 3},
      fields = {
        [1] = {name = "identifier", path = "fri.header.identifier", label = "Identifier", kind = "uint32", hexadecimal = true, names = {[2380098] = "monitoring", [212993] = "command"}},
        [2] = {name = "sequence_counter", path = "fri.header.sequence_counter", label = "Sequence counter", kind = "uint32"},
        [3] = {name = "reflected_sequence_counter", path = "fri.header.reflected_sequence_counter", label = "Reflected sequence counter", kind = "uint32"},
      },
    }},
    [2] = {name = "robot", path = "fri.robot", label = "Robot", kind = "message", message = {
      fields = {
        [1] = {name = "joint_count", path = "fri.robot.joint_count", label = "Joint count", kind = "int32"},
        [2] = {name = "safety_state", path = "fri.robot.safety_state", label = "Safety state", kind = "int32", names = {[0] = "NORMAL_OPERATION", [1] = "SAFETY_STOP_LEVEL_0", [2] = "SAFETY_STOP_LEVEL_1", [3] = "SAFETY_STOP_LEVEL_2"}},
        [5] = {name = "drive_state", path = "fri.robot.drive_state", label = "Drive state", kind = "int32", repeated = true, names = {[0] = "OFF", [1] = "TRANSITIONING", [2] = "ACTIVE"}},
        [6] = {name = "operation_mode", path = "fri.robot.operation_mode", label = "Operation mode", kind = "int32", names = {[0] = "T1", [1] = "T2", [2] = "AUT"}},
        [7] = {name = "control_mode", path = "fri.robot.control_mode", label = "Control mode", kind = "int32", names = {[0] = "POSITION", [1] = "CARTESIAN_IMPEDANCE", [2] = "JOINT_IMPEDANCE", [3] = "NO_CONTROL"}},
      },
    }},
    [3] = {name = "monitor", path = "fri.monitor", label = "Monitor", kind = "message", message = {
      fields = {
        [1] = {name = "measured_position", path = "fri.monitor.measured_position", label = "Measured position", kind = "vector", message = {
          fields = {
            [1] = {name = "value", path = "fri.monitor.measured_position", label = "Measured position", kind = "double", repeated = true},
          },
        }},
        [2] = {name = "measured_torque", path = "fri.monitor.measured_torque", label = "Measured torque", kind = "vector", message = {
          fields = {
            [1] = {name = "value", path = "fri.monitor.measured_torque", label = "Measured torque", kind = "double", repeated = true},
          },
        }},
        [3] = {name = "commanded_position", path = "fri.monitor.commanded_position", label = "Commanded position", kind = "vector", message = {
          fields = {
            [1] = {name = "value", path = "fri.monitor.commanded_position", label = "Commanded position", kind = "double", repeated = true},
          },
        }},
        [4] = {name = "commanded_torque", path = "fri.monitor.commanded_torque", label = "Commanded torque", kind = "vector", message = {
          fields = {
            [1] = {name = "value", path = "fri.monitor.commanded_torque", label = "Commanded torque", kind = "double", repeated = true},
          },
        }},
        [5] = {name = "external_torque", path = "fri.monitor.external_torque", label = "External torque", kind = "vector", message = {
          fields = {
            [1] = {name = "value", path = "fri.monitor.external_torque", label = "External torque", kind = "double", repeated = true},
          },
        }},
        [6] = {name = "external_force", path = "fri.monitor.external_force", label = "External force", kind = "vector", message = {
          fields = {
            [1] = {name = "value", path = "fri.monitor.external_force", label = "External force", kind = "double", repeated = true},
          },
        }},
        [8] = {name = "io", path = "fri.monitor.io", label = "Io", kind = "message", repeated = true, message = {
          required = {1, 2, 3},
          fields = {
            [1] = {name = "name", path = "fri.monitor.io.name", label = "Name", kind = "string"},
            [2] = {name = "type", path = "fri.monitor.io.type", label = "Type", kind = "int32", names = {[0] = "BOOLEAN", [1] = "DIGITAL", [2] = "ANALOG"}},
            [3] = {name = "direction", path = "fri.monitor.io.direction", label = "Direction", kind = "int32", names = {[0] = "INPUT", [1] = "OUTPUT"}},
            [4] = {name = "digital", path = "fri.monitor.io.digital", label = "Digital", kind = "uint64"},
            [5] = {name = "analog", path = "fri.monitor.io.analog", label = "Analog", kind = "double"},
          },
        }},
        [9] = {name = "measured_pose", path = "fri.monitor.measured_pose", label = "Measured pose", kind = "message", message = {
          required = {1},
          fields = {
            [1] = {name = "name", path = "fri.monitor.measured_pose.name", label = "Name", kind = "string"},
            [2] = {name = "value", path = "fri.monitor.measured_pose.value", label = "Value", kind = "double", repeated = true},
            [3] = {name = "at", path = "fri.monitor.measured_pose.at", label = "At", kind = "message", message = {
              required = {1, 2},
              fields = {
                [1] = {name = "seconds", path = "fri.monitor.measured_pose.at.seconds", label = "Seconds", kind = "uint32"},
                [2] = {name = "nanoseconds", path = "fri.monitor.measured_pose.at.nanoseconds", label = "Nanoseconds", kind = "uint32"},
              },
            }},
          },
        }},
        [10] = {name = "redundancy", path = "fri.monitor.redundancy", label = "Redundancy", kind = "message", message = {
          required = {1, 2},
          fields = {
            [1] = {name = "strategy", path = "fri.monitor.redundancy.strategy", label = "Strategy", kind = "int32", names = {[0] = "E1", [4] = "NONE"}},
            [2] = {name = "value", path = "fri.monitor.redundancy.value", label = "Value", kind = "double"},
          },
        }},
        [15] = {name = "at", path = "fri.monitor.at", label = "At", kind = "message", message = {
          required = {1, 2},
          fields = {
            [1] = {name = "seconds", path = "fri.monitor.at.seconds", label = "Seconds", kind = "uint32"},
            [2] = {name = "nanoseconds", path = "fri.monitor.at.nanoseconds", label = "Nanoseconds", kind = "uint32"},
          },
        }},
      },
    }},
    [4] = {name = "connection", path = "fri.connection", label = "Connection", kind = "message", message = {
      required = {1, 2},
      fields = {
        [1] = {name = "session_state", path = "fri.connection.session_state", label = "Session state", kind = "int32", names = {[0] = "IDLE", [1] = "MONITORING_WAIT", [2] = "MONITORING_READY", [3] = "COMMANDING_WAIT", [4] = "COMMANDING_ACTIVE"}},
        [2] = {name = "quality", path = "fri.connection.quality", label = "Quality", kind = "int32", names = {[0] = "POOR", [1] = "FAIR", [2] = "GOOD", [3] = "EXCELLENT"}},
        [3] = {name = "send_period_ms", path = "fri.connection.send_period_ms", label = "Send period [ms]", kind = "uint32"},
        [4] = {name = "receive_multiplier", path = "fri.connection.receive_multiplier", label = "Receive multiplier", kind = "uint32"},
      },
    }},
    [5] = {name = "ipo", path = "fri.ipo", label = "Ipo", kind = "message", message = {
      fields = {
        [1] = {name = "position", path = "fri.ipo.position", label = "Position", kind = "vector", message = {
          fields = {
            [1] = {name = "value", path = "fri.ipo.position", label = "Position", kind = "double", repeated = true},
          },
        }},
        [2] = {name = "pose", path = "fri.ipo.pose", label = "Pose", kind = "message", message = {
          required = {1},
          fields = {
            [1] = {name = "name", path = "fri.ipo.pose.name", label = "Name", kind = "string"},
            [2] = {name = "value", path = "fri.ipo.pose.value", label = "Value", kind = "double", repeated = true},
            [3] = {name = "at", path = "fri.ipo.pose.at", label = "At", kind = "message", message = {
              required = {1, 2},
              fields = {
                [1] = {name = "seconds", path = "fri.ipo.pose.at.seconds", label = "Seconds", kind = "uint32"},
                [2] = {name = "nanoseconds", path = "fri.ipo.pose.at.nanoseconds", label = "Nanoseconds", kind = "uint32"},
              },
            }},
          },
        }},
        [3] = {name = "redundancy", path = "fri.ipo.redundancy", label = "Redundancy", kind = "message", message = {
          required = {1, 2},
          fields = {
            [1] = {name = "strategy", path = "fri.ipo.redundancy.strategy", label = "Strategy", kind = "int32", names = {[0] = "E1", [4] = "NONE"}},
            [2] = {name = "value", path = "fri.ipo.redundancy.value", label = "Value", kind = "double"},
          },
        }},
        [10] = {name = "client_command_mode", path = "fri.ipo.client_command_mode", label = "Client command mode", kind = "int32", names = {[0] = "NONE", [1] = "JOINT_POSITION", [2] = "WRENCH", [3] = "TORQUE", [4] = "CARTESIAN_POSE"}},
        [11] = {name = "overlay_type", path = "fri.ipo.overlay_type", label = "Overlay type", kind = "int32", names = {[0] = "NONE", [1] = "JOINT", [2] = "CARTESIAN"}},
        [12] = {name = "tracking_performance", path = "fri.ipo.tracking_performance", label = "Tracking performance", kind = "double"},
      },
    }},
    [6] = {name = "requested_transformation", path = "fri.requested_transformation", label = "Requested transformation", kind = "message", repeated = true, message = {
      required = {1},
      fields = {
        [1] = {name = "name", path = "fri.requested_transformation.name", label = "Name", kind = "string"},
        [2] = {name = "value", path = "fri.requested_transformation.value", label = "Value", kind = "double", repeated = true},
        [3] = {name = "at", path = "fri.requested_transformation.at", label = "At", kind = "message", message = {
          required = {1, 2},
          fields = {
            [1] = {name = "seconds", path = "fri.requested_transformation.at.seconds", label = "Seconds", kind = "uint32"},
            [2] = {name = "nanoseconds", path = "fri.requested_transformation.at.nanoseconds", label = "Nanoseconds", kind = "uint32"},
          },
        }},
      },
    }},
    [15] = {name = "end_of", path = "fri.end_of", label = "End of", kind = "message", message = {
      fields = {
        [1] = {name = "message_length", path = "fri.end_of.message_length", label = "Message length", kind = "int32"},
        [2] = {name = "checksum", path = "fri.end_of.checksum", label = "Checksum", kind = "message", message = {
          fields = {
            [1] = {name = "crc", path = "fri.end_of.checksum.crc", label = "Crc", kind = "int32"},
          },
        }},
      },
    }},
  },
}

local FRI_COMMAND = {
  required = {1},
  fields = {
    [1] = {name = "header", path = "fri.header", label = "Header", kind = "message", message = {
      required = {1, 2, 3},
      fields = {
        [1] = {name = "identifier", path = "fri.header.identifier", label = "Identifier", kind = "uint32", hexadecimal = true, names = {[2380098] = "monitoring", [212993] = "command"}},
        [2] = {name = "sequence_counter", path = "fri.header.sequence_counter", label = "Sequence counter", kind = "uint32"},
        [3] = {name = "reflected_sequence_counter", path = "fri.header.reflected_sequence_counter", label = "Reflected sequence counter", kind = "uint32"},
      },
    }},
    [2] = {name = "command", path = "fri.command", label = "Command", kind = "message", message = {
      fields = {
        [1] = {name = "position", path = "fri.command.position", label = "Position", kind = "vector", message = {
          fields = {
            [1] = {name = "value", path = "fri.command.position", label = "Position", kind = "double", repeated = true},
          },
        }},
        [2] = {name = "wrench", path = "fri.command.wrench", label = "Wrench", kind = "vector", message = {
          fields = {
            [1] = {name = "value", path = "fri.command.wrench", label = "Wrench", kind = "double", repeated = true},
          },
        }},
        [3] = {name = "torque", path = "fri.command.torque", label = "Torque", kind = "vector", message = {
          fields = {
            [1] = {name = "value", path = "fri.command.torque", label = "Torque", kind = "double", repeated = true},
          },
        }},
        [4] = {name = "transformation", path = "fri.command.transformation", label = "Transformation", kind = "message", repeated = true, message = {
          required = {1},
          fields = {
            [1] = {name = "name", path = "fri.command.transformation.name", label = "Name", kind = "string"},
            [2] = {name = "value", path = "fri.command.transformation.value", label = "Value", kind = "double", repeated = true},
            [3] = {name = "at", path = "fri.command.transformation.at", label = "At", kind = "message", message = {
              required = {1, 2},
              fields = {
                [1] = {name = "seconds", path = "fri.command.transformation.at.seconds", label = "Seconds", kind = "uint32"},
                [2] = {name = "nanoseconds", path = "fri.command.transformation.at.nanoseconds", label = "Nanoseconds", kind = "uint32"},
              },
            }},
          },
        }},
        [5] = {name = "io", path = "fri.command.io", label = "Io", kind = "message", repeated = true, message = {
          required = {1, 2, 3},
          fields = {
            [1] = {name = "name", path = "fri.command.io.name", label = "Name", kind = "string"},
            [2] = {name = "type", path = "fri.command.io.type", label = "Type", kind = "int32", names = {[0] = "BOOLEAN", [1] = "DIGITAL", [2] = "ANALOG"}},
            [3] = {name = "direction", path = "fri.command.io.direction", label = "Direction", kind = "int32", names = {[0] = "INPUT", [1] = "OUTPUT"}},
            [4] = {name = "digital", path = "fri.command.io.digital", label = "Digital", kind = "uint64"},
            [5] = {name = "analog", path = "fri.command.io.analog", label = "Analog", kind = "double"},
          },
        }},
        [6] = {name = "pose", path = "fri.command.pose", label = "Pose", kind = "message", message = {
          required = {1},
          fields = {
            [1] = {name = "name", path = "fri.command.pose.name", label = "Name", kind = "string"},
            [2] = {name = "value", path = "fri.command.pose.value", label = "Value", kind = "double", repeated = true},
            [3] = {name = "at", path = "fri.command.pose.at", label = "At", kind = "message", message = {
              required = {1, 2},
              fields = {
                [1] = {name = "seconds", path = "fri.command.pose.at.seconds", label = "Seconds", kind = "uint32"},
                [2] = {name = "nanoseconds", path = "fri.command.pose.at.nanoseconds", label = "Nanoseconds", kind = "uint32"},
              },
            }},
          },
        }},
        [7] = {name = "redundancy", path = "fri.command.redundancy", label = "Redundancy", kind = "message", message = {
          required = {1, 2},
          fields = {
            [1] = {name = "strategy", path = "fri.command.redundancy.strategy", label = "Strategy", kind = "int32", names = {[0] = "E1", [4] = "NONE"}},
            [2] = {name = "value", path = "fri.command.redundancy.value", label = "Value", kind = "double"},
          },
        }},
      },
    }},
    [15] = {name = "end_of", path = "fri.end_of", label = "End of", kind = "message", message = {
      fields = {
        [1] = {name = "message_length", path = "fri.end_of.message_length", label = "Message length", kind = "int32"},
        [2] = {name = "checksum", path = "fri.end_of.checksum", label = "Checksum", kind = "message", message = {
          fields = {
            [1] = {name = "crc", path = "fri.end_of.checksum.crc", label = "Crc", kind = "int32"},
          },
        }},
      },
    }},
  },
}

local SERVO_PACKET = {
  fields = {
    [1] = {name = "header", path = "servo.header", label = "Header", kind = "message", frozen = true, message = {
      fields = {
        [1] = {name = "version", path = "servo.header.version", label = "Version", kind = "uint32", frozen = true},
        [2] = {name = "token", path = "servo.header.token", label = "Token", kind = "fixed64", hexadecimal = true, frozen = true},
        [3] = {name = "sequence", path = "servo.header.sequence", label = "Sequence", kind = "fixed64", frozen = true},
        [4] = {name = "reflected_sequence", path = "servo.header.reflected_sequence", label = "Reflected sequence", kind = "fixed64", frozen = true},
      },
    }},
    [2] = {name = "hello", path = "servo.hello", label = "Hello", kind = "message", frozen = true, message = {
      fields = {
        [1] = {name = "nonce", path = "servo.hello.nonce", label = "Nonce", kind = "fixed64", hexadecimal = true, frozen = true},
        [2] = {name = "role", path = "servo.hello.role", label = "Role", kind = "int32", names = {[0] = "ROLE_NONE", [1] = "ROLE_OBSERVER", [2] = "ROLE_COMMANDER", [3] = "ROLE_OPERATOR"}},
        [3] = {name = "watchdog_ms", path = "servo.hello.watchdog_ms", label = "Watchdog [ms]", kind = "uint32"},
        [4] = {name = "state_period_ms", path = "servo.hello.state_period_ms", label = "State period [ms]", kind = "uint32"},
        [5] = {name = "name", path = "servo.hello.name", label = "Name", kind = "string"},
        [6] = {name = "latency_budget_ms", path = "servo.hello.latency_budget_ms", label = "Latency budget [ms]", kind = "uint32"},
        [15] = {name = "padding", path = "servo.hello.padding", label = "Padding", kind = "bytes"},
      },
    }},
    [3] = {name = "welcome", path = "servo.welcome", label = "Welcome", kind = "message", frozen = true, message = {
      fields = {
        [1] = {name = "nonce", path = "servo.welcome.nonce", label = "Nonce", kind = "fixed64", hexadecimal = true, frozen = true},
        [2] = {name = "software", path = "servo.welcome.software", label = "Software", kind = "string", frozen = true},
        [3] = {name = "robot", path = "servo.welcome.robot", label = "Robot", kind = "string", frozen = true},
        [4] = {name = "cycle_ms", path = "servo.welcome.cycle_ms", label = "Cycle [ms]", kind = "uint32"},
        [5] = {name = "unix_epoch_ns", path = "servo.welcome.unix_epoch_ns", label = "Unix epoch [ns]", kind = "sfixed64"},
      },
    }},
    [4] = {name = "refused", path = "servo.refused", label = "Refused", kind = "message", frozen = true, message = {
      fields = {
        [1] = {name = "nonce", path = "servo.refused.nonce", label = "Nonce", kind = "fixed64", hexadecimal = true, frozen = true},
        [2] = {name = "reason", path = "servo.refused.reason", label = "Reason", kind = "string", frozen = true},
        [3] = {name = "try_again", path = "servo.refused.try_again", label = "Try again", kind = "bool", frozen = true},
      },
    }},
    [5] = {name = "command", path = "servo.command", label = "Command", kind = "message", message = {
      fields = {
        [1] = {name = "reports_seen", path = "servo.command.reports_seen", label = "Reports seen", kind = "fixed64"},
        [2] = {name = "wants_state", path = "servo.command.wants_state", label = "Wants state", kind = "bool"},
        [3] = {name = "request", path = "servo.command.request", label = "Request", kind = "message", repeated = true, message = {
          fields = {
            [1] = {name = "number", path = "servo.command.request.number", label = "Number", kind = "fixed64"},
            [2] = {name = "start", path = "servo.command.request.start", label = "Start", kind = "message", message = {
              fields = {
                [1] = {name = "kind", path = "servo.command.request.start.kind", label = "Kind", kind = "int32", names = {[0] = "KIND_NONE", [1] = "KIND_PTP", [2] = "KIND_SMART_SERVO", [3] = "KIND_DIRECT_SERVO"}},
                [2] = {name = "parameters", path = "servo.command.request.start.parameters", label = "Parameters", kind = "message", message = {
                  fields = {
                    [1] = {name = "joint_velocity_rel", path = "servo.command.request.start.parameters.joint_velocity_rel", label = "Joint velocity rel", kind = "double"},
                    [2] = {name = "joint_acceleration_rel", path = "servo.command.request.start.parameters.joint_acceleration_rel", label = "Joint acceleration rel", kind = "double"},
                    [3] = {name = "acceleration_override", path = "servo.command.request.start.parameters.acceleration_override", label = "Acceleration override", kind = "double"},
                    [4] = {name = "joint_jerk_percent", path = "servo.command.request.start.parameters.joint_jerk_percent", label = "Joint jerk [%]", kind = "double"},
                    [5] = {name = "minimum_execution_time_s", path = "servo.command.request.start.parameters.minimum_execution_time_s", label = "Minimum execution time [s]", kind = "double"},
                    [6] = {name = "speed_timeout_s", path = "servo.command.request.start.parameters.speed_timeout_s", label = "Speed timeout [s]", kind = "double"},
                    [7] = {name = "timeout_after_goal_s", path = "servo.command.request.start.parameters.timeout_after_goal_s", label = "Timeout after goal [s]", kind = "double"},
                    [8] = {name = "blending_rel", path = "servo.command.request.start.parameters.blending_rel", label = "Blending rel", kind = "double"},
                    [9] = {name = "velocity_planning", path = "servo.command.request.start.parameters.velocity_planning", label = "Velocity planning", kind = "bool"},
                    [10] = {name = "wait_for_pause", path = "servo.command.request.start.parameters.wait_for_pause", label = "Wait for pause", kind = "bool"},
                  },
                }},
                [3] = {name = "destination", path = "servo.command.request.start.destination", label = "Destination", kind = "vector", message = {
                  fields = {
                    [1] = {name = "value", path = "servo.command.request.start.destination", label = "Destination", kind = "double", repeated = true},
                  },
                }},
                [4] = {name = "flange_in_base", path = "servo.command.request.start.flange_in_base", label = "Flange in base", kind = "vector", message = {
                  fields = {
                    [1] = {name = "value", path = "servo.command.request.start.flange_in_base", label = "Flange in base", kind = "double", repeated = true},
                  },
                }},
                [5] = {name = "mode", path = "servo.command.request.start.mode", label = "Mode", kind = "message", message = {
                  fields = {
                    [1] = {name = "joint", path = "servo.command.request.start.mode.joint", label = "Joint", kind = "message", message = {
                      fields = {
                        [1] = {name = "stiffness", path = "servo.command.request.start.mode.joint.stiffness", label = "Stiffness", kind = "double", repeated = true},
                        [2] = {name = "damping", path = "servo.command.request.start.mode.joint.damping", label = "Damping", kind = "double", repeated = true},
                      },
                    }},
                    [2] = {name = "cartesian", path = "servo.command.request.start.mode.cartesian", label = "Cartesian", kind = "message", message = {
                      fields = {
                        [1] = {name = "stiffness", path = "servo.command.request.start.mode.cartesian.stiffness", label = "Stiffness", kind = "double", repeated = true},
                        [2] = {name = "damping", path = "servo.command.request.start.mode.cartesian.damping", label = "Damping", kind = "double", repeated = true},
                        [3] = {name = "null_space_stiffness_nm_rad", path = "servo.command.request.start.mode.cartesian.null_space_stiffness_nm_rad", label = "Null space stiffness [Nm/rad]", kind = "double"},
                        [4] = {name = "null_space_damping", path = "servo.command.request.start.mode.cartesian.null_space_damping", label = "Null space damping", kind = "double"},
                        [5] = {name = "additional_control_force", path = "servo.command.request.start.mode.cartesian.additional_control_force", label = "Additional control force", kind = "double", repeated = true},
                        [6] = {name = "max_control_force", path = "servo.command.request.start.mode.cartesian.max_control_force", label = "Max control force", kind = "double", repeated = true},
                        [7] = {name = "stop_on_max_control_force", path = "servo.command.request.start.mode.cartesian.stop_on_max_control_force", label = "Stop on max control force", kind = "bool"},
                        [8] = {name = "max_cartesian_velocity", path = "servo.command.request.start.mode.cartesian.max_cartesian_velocity", label = "Max cartesian velocity", kind = "double", repeated = true},
                        [9] = {name = "max_path_deviation", path = "servo.command.request.start.mode.cartesian.max_path_deviation", label = "Max path deviation", kind = "double", repeated = true},
                        [10] = {name = "oscillation", path = "servo.command.request.start.mode.cartesian.oscillation", label = "Oscillation", kind = "message", message = {
                          fields = {
                            [1] = {name = "amplitude", path = "servo.command.request.start.mode.cartesian.oscillation.amplitude", label = "Amplitude", kind = "double", repeated = true},
                            [2] = {name = "frequency_hz", path = "servo.command.request.start.mode.cartesian.oscillation.frequency_hz", label = "Frequency [Hz]", kind = "double", repeated = true},
                            [3] = {name = "phase_deg", path = "servo.command.request.start.mode.cartesian.oscillation.phase_deg", label = "Phase [deg]", kind = "double", repeated = true},
                            [4] = {name = "bias", path = "servo.command.request.start.mode.cartesian.oscillation.bias", label = "Bias", kind = "double", repeated = true},
                            [5] = {name = "force_limit", path = "servo.command.request.start.mode.cartesian.oscillation.force_limit", label = "Force limit", kind = "double", repeated = true},
                            [6] = {name = "position_limit", path = "servo.command.request.start.mode.cartesian.oscillation.position_limit", label = "Position limit", kind = "double", repeated = true},
                            [7] = {name = "rise_time_s", path = "servo.command.request.start.mode.cartesian.oscillation.rise_time_s", label = "Rise time [s]", kind = "double"},
                            [8] = {name = "hold_time_s", path = "servo.command.request.start.mode.cartesian.oscillation.hold_time_s", label = "Hold time [s]", kind = "double"},
                            [9] = {name = "fall_time_s", path = "servo.command.request.start.mode.cartesian.oscillation.fall_time_s", label = "Fall time [s]", kind = "double"},
                          },
                        }},
                      },
                    }},
                  },
                }},
                [6] = {name = "frame", path = "servo.command.request.start.frame", label = "Frame", kind = "string"},
                [7] = {name = "tool", path = "servo.command.request.start.tool", label = "Tool", kind = "message", message = {
                  fields = {
                    [1] = {name = "load", path = "servo.command.request.start.tool.load", label = "Load", kind = "message", message = {
                      fields = {
                        [1] = {name = "mass_kg", path = "servo.command.request.start.tool.load.mass_kg", label = "Mass [kg]", kind = "double"},
                        [2] = {name = "centre_m", path = "servo.command.request.start.tool.load.centre_m", label = "Centre [m]", kind = "double", repeated = true},
                        [3] = {name = "inertia_kg_m2", path = "servo.command.request.start.tool.load.inertia_kg_m2", label = "Inertia [kg m2]", kind = "double", repeated = true},
                      },
                    }},
                    [2] = {name = "tcp_in_flange", path = "servo.command.request.start.tool.tcp_in_flange", label = "Tcp in flange", kind = "vector", message = {
                      fields = {
                        [1] = {name = "value", path = "servo.command.request.start.tool.tcp_in_flange", label = "Tcp in flange", kind = "double", repeated = true},
                      },
                    }},
                  },
                }},
              },
            }},
            [3] = {name = "destination", path = "servo.command.request.destination", label = "Destination", kind = "message", message = {
              fields = {
                [1] = {name = "motion", path = "servo.command.request.destination.motion", label = "Motion", kind = "fixed64"},
                [2] = {name = "position", path = "servo.command.request.destination.position", label = "Position", kind = "vector", message = {
                  fields = {
                    [1] = {name = "value", path = "servo.command.request.destination.position", label = "Position", kind = "double", repeated = true},
                  },
                }},
                [3] = {name = "velocity", path = "servo.command.request.destination.velocity", label = "Velocity", kind = "vector", message = {
                  fields = {
                    [1] = {name = "value", path = "servo.command.request.destination.velocity", label = "Velocity", kind = "double", repeated = true},
                  },
                }},
                [4] = {name = "flange_in_base", path = "servo.command.request.destination.flange_in_base", label = "Flange in base", kind = "vector", message = {
                  fields = {
                    [1] = {name = "value", path = "servo.command.request.destination.flange_in_base", label = "Flange in base", kind = "double", repeated = true},
                  },
                }},
              },
            }},
            [4] = {name = "parameters", path = "servo.command.request.parameters", label = "Parameters", kind = "message", message = {
              fields = {
                [1] = {name = "motion", path = "servo.command.request.parameters.motion", label = "Motion", kind = "fixed64"},
                [2] = {name = "minimum_execution_time_s", path = "servo.command.request.parameters.minimum_execution_time_s", label = "Minimum execution time [s]", kind = "double"},
                [3] = {name = "velocity_planning", path = "servo.command.request.parameters.velocity_planning", label = "Velocity planning", kind = "bool"},
                [4] = {name = "wait_for_pause", path = "servo.command.request.parameters.wait_for_pause", label = "Wait for pause", kind = "bool"},
              },
            }},
            [5] = {name = "stop", path = "servo.command.request.stop", label = "Stop", kind = "message", message = {
              fields = {
                [1] = {name = "motion", path = "servo.command.request.stop.motion", label = "Motion", kind = "fixed64"},
              },
            }},
            [6] = {name = "describe", path = "servo.command.request.describe", label = "Describe", kind = "message", message = {
              fields = {
                [1] = {name = "place", path = "servo.command.request.describe.place", label = "Place", kind = "uint32"},
              },
            }},
            [7] = {name = "locate", path = "servo.command.request.locate", label = "Locate", kind = "message", message = {
              fields = {
                [1] = {name = "position", path = "servo.command.request.locate.position", label = "Position", kind = "double", repeated = true},
              },
            }},
            [8] = {name = "mode", path = "servo.command.request.mode", label = "Mode", kind = "message", message = {
              fields = {
                [1] = {name = "motion", path = "servo.command.request.mode.motion", label = "Motion", kind = "fixed64"},
                [2] = {name = "mode", path = "servo.command.request.mode.mode", label = "Mode", kind = "message", message = {
                  fields = {
                    [1] = {name = "joint", path = "servo.command.request.mode.mode.joint", label = "Joint", kind = "message", message = {
                      fields = {
                        [1] = {name = "stiffness", path = "servo.command.request.mode.mode.joint.stiffness", label = "Stiffness", kind = "double", repeated = true},
                        [2] = {name = "damping", path = "servo.command.request.mode.mode.joint.damping", label = "Damping", kind = "double", repeated = true},
                      },
                    }},
                    [2] = {name = "cartesian", path = "servo.command.request.mode.mode.cartesian", label = "Cartesian", kind = "message", message = {
                      fields = {
                        [1] = {name = "stiffness", path = "servo.command.request.mode.mode.cartesian.stiffness", label = "Stiffness", kind = "double", repeated = true},
                        [2] = {name = "damping", path = "servo.command.request.mode.mode.cartesian.damping", label = "Damping", kind = "double", repeated = true},
                        [3] = {name = "null_space_stiffness_nm_rad", path = "servo.command.request.mode.mode.cartesian.null_space_stiffness_nm_rad", label = "Null space stiffness [Nm/rad]", kind = "double"},
                        [4] = {name = "null_space_damping", path = "servo.command.request.mode.mode.cartesian.null_space_damping", label = "Null space damping", kind = "double"},
                        [5] = {name = "additional_control_force", path = "servo.command.request.mode.mode.cartesian.additional_control_force", label = "Additional control force", kind = "double", repeated = true},
                        [6] = {name = "max_control_force", path = "servo.command.request.mode.mode.cartesian.max_control_force", label = "Max control force", kind = "double", repeated = true},
                        [7] = {name = "stop_on_max_control_force", path = "servo.command.request.mode.mode.cartesian.stop_on_max_control_force", label = "Stop on max control force", kind = "bool"},
                        [8] = {name = "max_cartesian_velocity", path = "servo.command.request.mode.mode.cartesian.max_cartesian_velocity", label = "Max cartesian velocity", kind = "double", repeated = true},
                        [9] = {name = "max_path_deviation", path = "servo.command.request.mode.mode.cartesian.max_path_deviation", label = "Max path deviation", kind = "double", repeated = true},
                        [10] = {name = "oscillation", path = "servo.command.request.mode.mode.cartesian.oscillation", label = "Oscillation", kind = "message", message = {
                          fields = {
                            [1] = {name = "amplitude", path = "servo.command.request.mode.mode.cartesian.oscillation.amplitude", label = "Amplitude", kind = "double", repeated = true},
                            [2] = {name = "frequency_hz", path = "servo.command.request.mode.mode.cartesian.oscillation.frequency_hz", label = "Frequency [Hz]", kind = "double", repeated = true},
                            [3] = {name = "phase_deg", path = "servo.command.request.mode.mode.cartesian.oscillation.phase_deg", label = "Phase [deg]", kind = "double", repeated = true},
                            [4] = {name = "bias", path = "servo.command.request.mode.mode.cartesian.oscillation.bias", label = "Bias", kind = "double", repeated = true},
                            [5] = {name = "force_limit", path = "servo.command.request.mode.mode.cartesian.oscillation.force_limit", label = "Force limit", kind = "double", repeated = true},
                            [6] = {name = "position_limit", path = "servo.command.request.mode.mode.cartesian.oscillation.position_limit", label = "Position limit", kind = "double", repeated = true},
                            [7] = {name = "rise_time_s", path = "servo.command.request.mode.mode.cartesian.oscillation.rise_time_s", label = "Rise time [s]", kind = "double"},
                            [8] = {name = "hold_time_s", path = "servo.command.request.mode.mode.cartesian.oscillation.hold_time_s", label = "Hold time [s]", kind = "double"},
                            [9] = {name = "fall_time_s", path = "servo.command.request.mode.mode.cartesian.oscillation.fall_time_s", label = "Fall time [s]", kind = "double"},
                          },
                        }},
                      },
                    }},
                  },
                }},
              },
            }},
            [9] = {name = "validate", path = "servo.command.request.validate", label = "Validate", kind = "message", message = {
              fields = {
                [1] = {name = "frame", path = "servo.command.request.validate.frame", label = "Frame", kind = "string"},
                [2] = {name = "tool", path = "servo.command.request.validate.tool", label = "Tool", kind = "message", message = {
                  fields = {
                    [1] = {name = "load", path = "servo.command.request.validate.tool.load", label = "Load", kind = "message", message = {
                      fields = {
                        [1] = {name = "mass_kg", path = "servo.command.request.validate.tool.load.mass_kg", label = "Mass [kg]", kind = "double"},
                        [2] = {name = "centre_m", path = "servo.command.request.validate.tool.load.centre_m", label = "Centre [m]", kind = "double", repeated = true},
                        [3] = {name = "inertia_kg_m2", path = "servo.command.request.validate.tool.load.inertia_kg_m2", label = "Inertia [kg m2]", kind = "double", repeated = true},
                      },
                    }},
                    [2] = {name = "tcp_in_flange", path = "servo.command.request.validate.tool.tcp_in_flange", label = "Tcp in flange", kind = "vector", message = {
                      fields = {
                        [1] = {name = "value", path = "servo.command.request.validate.tool.tcp_in_flange", label = "Tcp in flange", kind = "double", repeated = true},
                      },
                    }},
                  },
                }},
              },
            }},
            [10] = {name = "push", path = "servo.command.request.push", label = "Push", kind = "message", message = {
              fields = {
                [1] = {name = "link", path = "servo.command.request.push.link", label = "Link", kind = "uint32"},
                [2] = {name = "force_n", path = "servo.command.request.push.force_n", label = "Force [N]", kind = "double", repeated = true},
                [3] = {name = "moment_nm", path = "servo.command.request.push.moment_nm", label = "Moment [Nm]", kind = "double", repeated = true},
                [4] = {name = "duration_s", path = "servo.command.request.push.duration_s", label = "Duration [s]", kind = "double"},
              },
            }},
          },
        }},
      },
    }},
    [6] = {name = "goodbye", path = "servo.goodbye", label = "Goodbye", kind = "message", message = {
      fields = {
      },
    }},
    [7] = {name = "state", path = "servo.state", label = "State", kind = "message", message = {
      fields = {
        [1] = {name = "requests_done", path = "servo.state.requests_done", label = "Requests done", kind = "fixed64"},
        [2] = {name = "snapshot", path = "servo.state.snapshot", label = "Snapshot", kind = "message", message = {
          fields = {
            [1] = {name = "now_ns", path = "servo.state.snapshot.now_ns", label = "Now [ns]", kind = "sfixed64"},
            [2] = {name = "cycle", path = "servo.state.snapshot.cycle", label = "Cycle", kind = "fixed64"},
            [3] = {name = "operation_mode", path = "servo.state.snapshot.operation_mode", label = "Operation mode", kind = "int32", names = {[0] = "MODE_T1", [1] = "MODE_T2", [2] = "MODE_AUT"}},
            [4] = {name = "program", path = "servo.state.snapshot.program", label = "Program", kind = "int32", names = {[0] = "PROGRAM_NONE", [1] = "PROGRAM_RUNNING", [2] = "PROGRAM_PAUSED", [3] = "PROGRAM_STOPPED", [4] = "PROGRAM_EMERGENCY_STOP"}},
            [5] = {name = "enabling", path = "servo.state.snapshot.enabling", label = "Enabling", kind = "bool"},
            [6] = {name = "override_percent", path = "servo.state.snapshot.override_percent", label = "Override [%]", kind = "double"},
            [7] = {name = "safety_state", path = "servo.state.snapshot.safety_state", label = "Safety state", kind = "int32", names = {[0] = "SAFETY_NORMAL_OPERATION", [1] = "SAFETY_STOP_LEVEL_0", [2] = "SAFETY_STOP_LEVEL_1", [3] = "SAFETY_STOP_LEVEL_2"}},
            [8] = {name = "permissive", path = "servo.state.snapshot.permissive", label = "Permissive", kind = "bool"},
            [9] = {name = "measured_position", path = "servo.state.snapshot.measured_position", label = "Measured position", kind = "double", repeated = true},
            [10] = {name = "commanded_position", path = "servo.state.snapshot.commanded_position", label = "Commanded position", kind = "double", repeated = true},
            [11] = {name = "measured_torque", path = "servo.state.snapshot.measured_torque", label = "Measured torque", kind = "double", repeated = true},
            [12] = {name = "external_torque", path = "servo.state.snapshot.external_torque", label = "External torque", kind = "double", repeated = true},
            [13] = {name = "commander", path = "servo.state.snapshot.commander", label = "Commander", kind = "string"},
            [14] = {name = "operator_reason", path = "servo.state.snapshot.operator_reason", label = "Operator reason", kind = "string"},
            [15] = {name = "motion", path = "servo.state.snapshot.motion", label = "Motion", kind = "message", repeated = true, message = {
              fields = {
                [1] = {name = "motion", path = "servo.state.snapshot.motion.motion", label = "Motion", kind = "fixed64"},
                [2] = {name = "kind", path = "servo.state.snapshot.motion.kind", label = "Kind", kind = "int32", names = {[0] = "KIND_NONE", [1] = "KIND_PTP", [2] = "KIND_SMART_SERVO", [3] = "KIND_DIRECT_SERVO"}},
                [3] = {name = "phase", path = "servo.state.snapshot.motion.phase", label = "Phase", kind = "int32", names = {[0] = "PHASE_NONE", [1] = "PHASE_QUEUED", [2] = "PHASE_TRANSFERRED", [3] = "PHASE_ACTIVE", [4] = "PHASE_ENDED"}},
                [4] = {name = "interpolator", path = "servo.state.snapshot.motion.interpolator", label = "Interpolator", kind = "int32", names = {[0] = "INTERPOLATOR_NONE", [1] = "INTERPOLATOR_MOVING", [2] = "INTERPOLATOR_VELOCITY_AFTER_GOAL_REACH", [3] = "INTERPOLATOR_RESTING", [4] = "INTERPOLATOR_ENDED"}},
                [5] = {name = "destination", path = "servo.state.snapshot.motion.destination", label = "Destination", kind = "double", repeated = true},
                [6] = {name = "destination_at_ns", path = "servo.state.snapshot.motion.destination_at_ns", label = "Destination at [ns]", kind = "sfixed64"},
                [7] = {name = "remaining_s", path = "servo.state.snapshot.motion.remaining_s", label = "Remaining [s]", kind = "double"},
                [8] = {name = "goals_reached", path = "servo.state.snapshot.motion.goals_reached", label = "Goals reached", kind = "fixed64"},
                [9] = {name = "received", path = "servo.state.snapshot.motion.received", label = "Received", kind = "fixed64"},
                [10] = {name = "superseded", path = "servo.state.snapshot.motion.superseded", label = "Superseded", kind = "fixed64"},
                [11] = {name = "executed", path = "servo.state.snapshot.motion.executed", label = "Executed", kind = "fixed64"},
                [12] = {name = "executed_at_ns", path = "servo.state.snapshot.motion.executed_at_ns", label = "Executed at [ns]", kind = "sfixed64"},
              },
            }},
            [16] = {name = "flange_in_base", path = "servo.state.snapshot.flange_in_base", label = "Flange in base", kind = "vector", message = {
              fields = {
                [1] = {name = "value", path = "servo.state.snapshot.flange_in_base", label = "Flange in base", kind = "double", repeated = true},
              },
            }},
            [17] = {name = "control_mode", path = "servo.state.snapshot.control_mode", label = "Control mode", kind = "int32", names = {[0] = "CONTROL_POSITION", [1] = "CONTROL_CARTESIAN_IMPEDANCE", [2] = "CONTROL_JOINT_IMPEDANCE", [3] = "CONTROL_NONE"}},
            [18] = {name = "external_torque_variance", path = "servo.state.snapshot.external_torque_variance", label = "External torque variance", kind = "float", repeated = true},
            [19] = {name = "flange_force", path = "servo.state.snapshot.flange_force", label = "Flange force", kind = "float", repeated = true},
            [20] = {name = "flange_force_variance", path = "servo.state.snapshot.flange_force_variance", label = "Flange force variance", kind = "float", repeated = true},
            [21] = {name = "flange_speed_mm_s", path = "servo.state.snapshot.flange_speed_mm_s", label = "Flange speed [mm/s]", kind = "float"},
            [22] = {name = "contact", path = "servo.state.snapshot.contact", label = "Contact", kind = "message", repeated = true, message = {
              fields = {
                [1] = {name = "point_m", path = "servo.state.snapshot.contact.point_m", label = "Point [m]", kind = "float", repeated = true},
                [2] = {name = "force_n", path = "servo.state.snapshot.contact.force_n", label = "Force [N]", kind = "float", repeated = true},
              },
            }},
          },
        }},
        [3] = {name = "report", path = "servo.state.report", label = "Report", kind = "message", repeated = true, message = {
          fields = {
            [1] = {name = "number", path = "servo.state.report.number", label = "Number", kind = "fixed64"},
            [2] = {name = "at_ns", path = "servo.state.report.at_ns", label = "At [ns]", kind = "sfixed64"},
            [3] = {name = "done", path = "servo.state.report.done", label = "Done", kind = "message", message = {
              fields = {
                [1] = {name = "request", path = "servo.state.report.done.request", label = "Request", kind = "fixed64"},
                [2] = {name = "error", path = "servo.state.report.done.error", label = "Error", kind = "int32", names = {[0] = "ERROR_NONE", [1] = "ERROR_ILLEGAL_ARGUMENT", [2] = "ERROR_ILLEGAL_STATE", [3] = "ERROR_COMMAND_INVALID"}},
                [3] = {name = "reason", path = "servo.state.report.done.reason", label = "Reason", kind = "string"},
                [4] = {name = "detail", path = "servo.state.report.done.detail", label = "Detail", kind = "string"},
              },
            }},
            [4] = {name = "goal", path = "servo.state.report.goal", label = "Goal", kind = "message", message = {
              fields = {
                [1] = {name = "motion", path = "servo.state.report.goal.motion", label = "Motion", kind = "fixed64"},
                [2] = {name = "state", path = "servo.state.report.goal.state", label = "State", kind = "int32", names = {[0] = "INTERPOLATOR_NONE", [1] = "INTERPOLATOR_MOVING", [2] = "INTERPOLATOR_VELOCITY_AFTER_GOAL_REACH", [3] = "INTERPOLATOR_RESTING", [4] = "INTERPOLATOR_ENDED"}},
                [3] = {name = "position", path = "servo.state.report.goal.position", label = "Position", kind = "double", repeated = true},
              },
            }},
            [5] = {name = "ended", path = "servo.state.report.ended", label = "Ended", kind = "message", message = {
              fields = {
                [1] = {name = "motion", path = "servo.state.report.ended.motion", label = "Motion", kind = "fixed64"},
                [2] = {name = "end", path = "servo.state.report.ended.end", label = "End", kind = "int32", names = {[0] = "END_NONE", [1] = "END_FINISHED", [2] = "END_STOPPED", [3] = "END_FAILED"}},
                [3] = {name = "reason", path = "servo.state.report.ended.reason", label = "Reason", kind = "string"},
                [4] = {name = "detail", path = "servo.state.report.ended.detail", label = "Detail", kind = "string"},
              },
            }},
            [6] = {name = "frame", path = "servo.state.report.frame", label = "Frame", kind = "message", message = {
              fields = {
                [1] = {name = "request", path = "servo.state.report.frame.request", label = "Request", kind = "fixed64"},
                [2] = {name = "of", path = "servo.state.report.frame.of", label = "Of", kind = "uint32"},
                [3] = {name = "name", path = "servo.state.report.frame.name", label = "Name", kind = "string"},
                [4] = {name = "kind", path = "servo.state.report.frame.kind", label = "Kind", kind = "int32", names = {[0] = "FRAME_NONE", [1] = "FRAME_WORLD", [2] = "FRAME_BASE", [3] = "FRAME_FLANGE", [4] = "FRAME_TOOL", [5] = "FRAME_TOOL_FRAME", [6] = "FRAME_REFERENCE"}},
                [5] = {name = "parent", path = "servo.state.report.frame.parent", label = "Parent", kind = "string"},
                [6] = {name = "in_parent", path = "servo.state.report.frame.in_parent", label = "In parent", kind = "vector", message = {
                  fields = {
                    [1] = {name = "value", path = "servo.state.report.frame.in_parent", label = "In parent", kind = "double", repeated = true},
                  },
                }},
                [7] = {name = "load", path = "servo.state.report.frame.load", label = "Load", kind = "message", message = {
                  fields = {
                    [1] = {name = "mass_kg", path = "servo.state.report.frame.load.mass_kg", label = "Mass [kg]", kind = "double"},
                    [2] = {name = "centre_m", path = "servo.state.report.frame.load.centre_m", label = "Centre [m]", kind = "double", repeated = true},
                    [3] = {name = "inertia_kg_m2", path = "servo.state.report.frame.load.inertia_kg_m2", label = "Inertia [kg m2]", kind = "double", repeated = true},
                  },
                }},
              },
            }},
            [7] = {name = "flange", path = "servo.state.report.flange", label = "Flange", kind = "message", message = {
              fields = {
                [1] = {name = "request", path = "servo.state.report.flange.request", label = "Request", kind = "fixed64"},
                [2] = {name = "flange_in_base", path = "servo.state.report.flange.flange_in_base", label = "Flange in base", kind = "vector", message = {
                  fields = {
                    [1] = {name = "value", path = "servo.state.report.flange.flange_in_base", label = "Flange in base", kind = "double", repeated = true},
                  },
                }},
              },
            }},
            [8] = {name = "load", path = "servo.state.report.load", label = "Load", kind = "message", message = {
              fields = {
                [1] = {name = "request", path = "servo.state.report.load.request", label = "Request", kind = "fixed64"},
                [2] = {name = "reason", path = "servo.state.report.load.reason", label = "Reason", kind = "string"},
              },
            }},
          },
        }},
      },
    }},
    [8] = {name = "ended", path = "servo.ended", label = "Ended", kind = "message", message = {
      fields = {
        [1] = {name = "reason", path = "servo.ended.reason", label = "Reason", kind = "string"},
      },
    }},
  },
}

-- Protobuf on the wire: bytes to nodes, with nothing of Wireshark's. Offsets count from 0, as Wireshark's do.
--
-- A node is {field, from, to}: from its tag to its end. A message has its nodes in `nodes`; a number of a varint is in
-- `low` and `high`, 32 bits each; anything else stands in the bytes from `at` to `to`. Repeated numbers of one message
-- are one node with `elements`, packed or not. A node without a field is of a number or a form the schema does not know.

local WIRE_TYPES = {
  double = 1, float = 5, uint32 = 0, int32 = 0, uint64 = 0, bool = 0, fixed64 = 1, sfixed64 = 1,
  string = 2, bytes = 2, message = 2, vector = 2,
}
local UTF8 = {
  "[\194-\223][\128-\191]",
  "\224[\160-\191][\128-\191]",
  "[\225-\236\238\239][\128-\191][\128-\191]",
  "\237[\128-\159][\128-\191]",
  "\240[\144-\191][\128-\191][\128-\191]",
  "[\241-\243][\128-\191][\128-\191][\128-\191]",
  "\244[\128-\143][\128-\191][\128-\191]",
}
local POWERS = {1, 128, 16384, 2097152}

-- Returns both halves of a varint and where it ends; nil and what is wrong.
local function read_varint(raw, at, stop)
  local low, high = 0, 0
  for index = 0, 9 do
    if at + index >= stop then return nil, "a number that is cut off" end
    local byte = raw:byte(at + index + 1)
    local bits = byte % 128
    if index < 4 then
      low = low + bits * POWERS[index + 1]
    elseif index == 4 then
      low = low + bits % 16 * 268435456
      high = (bits - bits % 16) / 16
    elseif index < 9 then
      high = high + bits * POWERS[index - 4] * 8
    else
      high = high + bits % 2 * 2147483648
    end
    if byte < 128 then return low, high, at + index + 1 end
  end
  return nil, "a number of more than ten bytes"
end

-- Returns where the value of a field begins and ends, and the halves of a varint; nil and what is wrong.
local function measure(raw, wire_type, at, stop)
  if wire_type == 0 then
    local low, high, to = read_varint(raw, at, stop)
    if not low then return nil, high end
    return at, to, low, high
  end
  local size
  if wire_type == 1 then
    size = 8
  elseif wire_type == 5 then
    size = 4
  elseif wire_type == 2 then
    local high, value_at
    size, high, value_at = read_varint(raw, at, stop)
    if not size then return nil, high end
    if high > 0 then return nil, "four gigabytes or more are announced" end
    at = value_at
  else
    return nil, string.format("wire type %d, which FRI and the servo link do not use", wire_type)
  end
  if at + size > stop then
    return nil, string.format("%.0f bytes are announced, %d are left", size, stop - at)
  end
  return at, at + size
end

local function is_utf8(text)
  for _, character in ipairs(UTF8) do text = text:gsub(character, "?") end
  return not text:find("[\128-\255]")
end

local function add_element(elements, from, to, at, low, high)
  elements[#elements + 1] = {from = from, to = to, at = at, low = low, high = high}
end

-- Adds the numbers of a packed field; returns false at one that is cut off.
local function unpack_elements(raw, field, at, to, elements, problems)
  while at < to do
    local value_at, stop, low, high = measure(raw, WIRE_TYPES[field.kind], at, to)
    if not value_at then
      problems[#problems + 1] = {at = at, text = field.path .. ": " .. stop}
      return false
    end
    add_element(elements, at, stop, at, low, high)
    at = stop
  end
  return true
end

-- Returns the nodes of the message in the bytes from `at` to `stop`. What cannot be read is added to `problems`, and
-- ends its message. `frozen_only`: fields that may mean something else in other versions count as unknown.
local function parse(message, raw, at, stop, problems, frozen_only)
  local nodes, found, start = {}, {}, at
  local function fail(where, text)
    problems[#problems + 1] = {at = where, text = text}
    return nodes
  end
  while at < stop do
    local from = at
    local tag, tag_high, after_tag = read_varint(raw, at, stop)
    if not tag then return fail(from, tag_high) end
    local wire_type = tag % 8
    local number = (tag - wire_type) / 8
    if number == 0 or tag_high > 0 then return fail(from, "a field number that cannot be") end
    local value_at, to, low, high = measure(raw, wire_type, after_tag, stop)
    if not value_at then return fail(from, string.format("field %d: %s", number, to)) end

    local field = message.fields[number]
    if field and frozen_only and not field.frozen then field = nil end
    local fits = field and wire_type == WIRE_TYPES[field.kind]
    local numbers = field and field.repeated and not field.message
    local packed = numbers and wire_type == 2
    if not fits and not packed then
      nodes[#nodes + 1] = {number = number, wire_type = wire_type, from = from, to = to}
    elseif numbers then
      local node = found[number]
      if not node then
        node = {field = field, from = from, elements = {}}
        nodes[#nodes + 1] = node
        found[number] = node
      end
      node.to = to
      if not packed then
        add_element(node.elements, from, to, value_at, low, high)
      elseif not unpack_elements(raw, field, value_at, to, node.elements, problems) then
        return nodes
      end
    else
      local node = {field = field, from = from, to = to, at = value_at, low = low, high = high}
      if field.message then node.nodes = parse(field.message, raw, value_at, to, problems, frozen_only) end
      if field.kind == "string" and not is_utf8(raw:sub(value_at + 1, to)) then
        fail(value_at, field.path .. " is no UTF-8")
      end
      nodes[#nodes + 1] = node
      found[number] = node
    end
    at = to
  end
  for _, number in ipairs(message.required or {}) do
    if not found[number] then fail(start, message.fields[number].path .. " is missing") end
  end
  return nodes
end

-- The last node of a field, which is the one that counts; nil without.
local function last(nodes, name)
  for index = #(nodes or {}), 1, -1 do
    local node = nodes[index]
    if node.field and node.field.name == name then return node end
  end
  return nil
end

-- CRC-32 as zlib computes it. Bits that overflow are harmless: only the low 32 count, whatever sign the library gives.
local xor = bit and bit.bxor or load("return function(a, b) return a ~ b end")()
local CRC_TABLE = {}
for index = 0, 255 do
  local crc = index
  for _ = 1, 8 do
    local odd = crc % 2
    crc = (crc - odd) / 2
    if odd == 1 then crc = xor(crc, 0xEDB88320) % 4294967296 end
  end
  CRC_TABLE[index] = crc
end

local function crc32(raw, from, to)
  local crc = 4294967295
  for index = from + 1, to do
    local low = crc % 256
    crc = xor(CRC_TABLE[xor(low, raw:byte(index))], (crc - low) / 256) % 4294967296
  end
  return 4294967295 - crc
end

local function little_endian(raw, at)
  local a, b, c, d = raw:byte(at + 1, at + 4)
  return a + b * 256 + c * 65536 + d * 16777216
end

-- Nodes to what Wireshark shows: fields, texts, experts.

local MOST_NUMBERS_SHOWN = 16

-- Returns text fit for a column, whatever a peer sent.
local function plain(text)
  if not is_utf8(text) then text = text:gsub("[\128-\255]", "?") end
  return (text:gsub("[\0-\31\127]", "?"))
end

local function signed(low)
  return low < 2147483648 and low or low - 4294967296
end

local function make_handle(field)
  local path, label, base_of = field.path, field.label, field.hexadecimal and base.HEX or base.DEC
  local kind = field.kind
  if kind == "message" then return ProtoField.none(path, label) end
  if kind == "double" then return ProtoField.double(path, label) end
  if kind == "float" then return ProtoField.float(path, label) end
  if kind == "uint32" then return ProtoField.uint32(path, label, base_of, field.names) end
  if kind == "int32" then return ProtoField.int32(path, label, base.DEC, field.names) end
  if kind == "uint64" or kind == "fixed64" then return ProtoField.uint64(path, label, base_of) end
  if kind == "sfixed64" then return ProtoField.int64(path, label) end
  if kind == "bool" then return ProtoField.bool(path, label) end
  if kind == "string" then return ProtoField.string(path, label, base.UNICODE) end
  return ProtoField.bytes(path, label)
end

-- Adds the ProtoFields of a message and of all below it to `handles`; what two messages share is one.
local function make_handles(message, handles)
  for _, field in pairs(message.fields) do
    if field.kind ~= "vector" and not handles[field.path] then handles[field.path] = make_handle(field) end
    if field.repeated and not field.message then
      local count = field.path .. ".count"
      handles[count] = handles[count] or ProtoField.uint32(count, field.label .. ", count")
    end
    if field.message then make_handles(field.message, handles) end
  end
end

-- What all messages of a protocol are shown with.
local function make_protocol(name, description, messages, more)
  local protocol = {proto = Proto(name, description), handles = more}
  for _, message in ipairs(messages) do make_handles(message, protocol.handles) end
  protocol.handles.unknown = ProtoField.bytes(name .. ".unknown", "Unknown field")
  protocol.malformed = ProtoExpert.new(name .. ".malformed", "Malformed", expert.group.MALFORMED, expert.severity.ERROR)
  protocol.proto.fields = protocol.handles
  return protocol
end

local function add_value(branch, tvb, handle, field, node)
  local kind, size = field.kind, node.to - node.at
  if kind == "double" or kind == "float" or kind == "fixed64" or kind == "sfixed64" then
    return branch:add_le(handle, tvb(node.at, size))
  elseif kind == "uint32" then
    return branch:add(handle, tvb(node.at, size), node.low)
  elseif kind == "int32" then
    return branch:add(handle, tvb(node.at, size), signed(node.low))
  elseif kind == "uint64" then
    return branch:add(handle, tvb(node.at, size), UInt64.new(node.low, node.high))
  elseif kind == "bool" then
    return branch:add(handle, tvb(node.at, size), node.low > 0 or node.high > 0)
  elseif kind == "string" then
    return branch:add_packet_field(handle, tvb(node.at, size), ENC_UTF_8)
  end
  return branch:add(handle, tvb(node.at, size))
end

local function number_text(tvb, field, element)
  if field.kind == "double" or field.kind == "float" then
    return string.format("%.6g", tvb(element.at, element.to - element.at):le_float())
  end
  local number = field.kind == "int32" and signed(element.low) or element.low
  return field.names and field.names[number] or string.format("%d", number)
end

-- Adds repeated numbers below their count. Texts only where somebody sees them: they cost more than the numbers.
local function add_numbers(branch, tvb, protocol, field, node)
  local count = branch:add(protocol.handles[field.path .. ".count"], tvb(node.from, node.to - node.from), #node.elements)
  local handle, visible, texts = protocol.handles[field.path], branch.visible, {}
  for index, element in ipairs(node.elements) do
    local item = add_value(count, tvb, handle, field, element)
    if visible then
      item:prepend_text(string.format("[%d] ", index))
      if index <= MOST_NUMBERS_SHOWN then
        texts[index] = number_text(tvb, field, element)
      elseif index == MOST_NUMBERS_SHOWN + 1 then
        texts[index] = "..."
      end
    end
  end
  if visible then count:set_text(field.label .. ": " .. (#texts > 0 and table.concat(texts, ", ") or "none")) end
end

local add_nodes

local function add_vector(branch, tvb, protocol, node)
  local element = node.field.message.fields[1]
  local numbers = {from = node.from, to = node.to, elements = {}}
  local others = {}
  for _, inner in ipairs(node.nodes) do
    if inner.elements then numbers.elements = inner.elements else others[#others + 1] = inner end
  end
  add_numbers(branch, tvb, protocol, element, numbers)
  add_nodes(branch, tvb, protocol, others)
end

function add_nodes(branch, tvb, protocol, nodes)
  for _, node in ipairs(nodes) do
    local field = node.field
    if not field then
      local item = branch:add(protocol.handles.unknown, tvb(node.from, node.to - node.from))
      item:prepend_text(string.format("Number %d, wire type %d: ", node.number, node.wire_type))
    elseif field.kind == "vector" then
      add_vector(branch, tvb, protocol, node)
    elseif node.elements then
      add_numbers(branch, tvb, protocol, field, node)
    elseif node.nodes then
      local inner = branch:add(protocol.handles[field.path], tvb(node.from, node.to - node.from))
      add_nodes(inner, tvb, protocol, node.nodes)
    else
      add_value(branch, tvb, protocol.handles[field.path], field, node)
    end
  end
end

-- Adds what could not be read, each at its offset; returns what the column says of it.
local function add_problems(branch, tvb, protocol, problems)
  if tvb:captured_len() < tvb:reported_len() then
    table.insert(problems, 1, {at = tvb:len(), text = "the recorder cut this packet"})
  end
  for _, problem in ipairs(problems) do
    local text = string.format("Malformed at byte %d: %s", problem.at, problem.text)
    local item = branch:add(tvb(problem.at, math.min(1, tvb:len() - problem.at)), text)
    item:add_proto_expert_info(protocol.malformed, text)
  end
  return #problems > 0 and " [malformed: " .. plain(problems[1].text) .. "]" or ""
end

-- Registers for ports that the user may change, and for any other port by what the packets look like.
local function register(protocol, ports, what, recognise)
  local proto = protocol.proto
  local udp_ports = DissectorTable.get("udp.port")
  local registered = ports
  proto.prefs.ports = Pref.range("UDP ports", ports, "Packets of these ports are " .. what .. " even when broken", 65535)
  udp_ports:add(registered, proto)
  function proto.prefs_changed()
    if proto.prefs.ports == registered then return end
    if registered ~= "" then udp_ports:remove(registered, proto) end
    registered = proto.prefs.ports
    if registered ~= "" then udp_ports:add(registered, proto) end
  end
  proto:register_heuristic("udp", function(tvb, pinfo, tree)
    if not recognise(tvb:raw()) then return false end
    proto.dissector(tvb, pinfo, tree)
    return true
  end)
end

-- FRI: bare (1.x, 2.5) or between length and CRC (2.7); which of both a packet shows by itself.

local fri = make_protocol("fri", "KUKA Fast Robot Interface", {FRI_MONITORING, FRI_COMMAND}, {
  length = ProtoField.uint32("fri.frame.length", "Length of the message"),
  crc = ProtoField.uint32("fri.frame.crc", "CRC-32", base.HEX),
  answer_to = ProtoField.framenum("fri.answer_to", "Answer to", base.NONE, frametype.REQUEST),
  answer_latency = ProtoField.relative_time("fri.answer_latency", "Answer latency"),
})
local fri_crc_wrong = ProtoExpert.new("fri.frame.crc_wrong", "CRC wrong", expert.group.CHECKSUM, expert.severity.ERROR)
local fri_length_wrong =
  ProtoExpert.new("fri.frame.length_wrong", "Length wrong", expert.group.MALFORMED, expert.severity.ERROR)
fri.proto.experts = {fri.malformed, fri_crc_wrong, fri_length_wrong}

-- Monitoring messages whose answers may still come, by conversation and sequence counter: the last 4096 of each.
local ANSWERABLE = 4096
-- An older message with the same counter is of another session, and the one that was answered is not in the capture.
local LONGEST_LATENCY_S = 10
local fri_sent = {}
-- What was found in the first pass, because Wireshark dissects a packet again whenever it shows it.
local fri_answers = {}

function fri.proto.init()
  fri_sent, fri_answers = {}, {}
end

-- The message identifier of the message that begins at `at`; nil where none does.
local function fri_identifier(raw, at)
  if raw:byte(at + 1) ~= 0x0A or raw:byte(at + 3) ~= 0x08 then return nil end
  local low, high = read_varint(raw, at + 3, #raw)
  return low and high == 0 and low or nil
end

local function is_known(identifier)
  return identifier == FRI_MONITORING_IDENTIFIER or identifier == FRI_COMMAND_IDENTIFIER
end

local function is_fri(raw)
  return is_known(fri_identifier(raw, 4)) or is_known(fri_identifier(raw, 0))
end

-- Shows length and CRC; returns where the message is.
local function add_frame(branch, tvb, raw, problems)
  local length = little_endian(raw, 0)
  local stop = math.min(4 + length, #raw)
  local item = branch:add_le(fri.handles.length, tvb(0, 4))
  if length + 8 ~= tvb:reported_len() then
    item:add_proto_expert_info(
      fri_length_wrong,
      string.format("The length says %d bytes, the packet has room for %d", length, tvb:reported_len() - 8)
    )
  end
  if stop + 4 > #raw then
    problems[#problems + 1] = {at = #raw, text = "the CRC is cut off"}
    return stop, ""
  end
  item = branch:add_le(fri.handles.crc, tvb(stop, 4))
  local crc = crc32(raw, 4, stop)
  if crc == little_endian(raw, stop) then return stop, "" end
  item:add_proto_expert_info(fri_crc_wrong, string.format("The message has CRC 0x%08x", crc))
  return stop, " [CRC wrong]"
end

local function conversation(from, from_port, to, to_port)
  return string.format("%s:%d>%s:%d", tostring(from), from_port, tostring(to), to_port)
end

local function remember(pinfo, counter)
  local key = conversation(pinfo.src, pinfo.src_port, pinfo.dst, pinfo.dst_port)
  fri_sent[key] = fri_sent[key] or {}
  fri_sent[key][counter % ANSWERABLE] = {counter = counter, number = pinfo.number, at_s = pinfo.rel_ts}
end

local function find_answered(pinfo, counter)
  local sent = fri_sent[conversation(pinfo.dst, pinfo.dst_port, pinfo.src, pinfo.src_port)]
  local message = sent and sent[counter % ANSWERABLE]
  if not message or message.counter ~= counter or pinfo.rel_ts - message.at_s > LONGEST_LATENCY_S then return end
  local latency_ns = math.floor((pinfo.rel_ts - message.at_s) * 1e9 + 0.5)
  local seconds = math.floor(latency_ns / 1e9)
  fri_answers[pinfo.number] = {
    number = message.number,
    latency = NSTime.new(seconds, math.floor(latency_ns - seconds * 1e9)),
  }
end

local function add_answered(branch, pinfo)
  local answered = fri_answers[pinfo.number]
  if not answered then return end
  branch:add(fri.handles.answer_to, answered.number):set_generated()
  branch:add(fri.handles.answer_latency, answered.latency):set_generated()
end

local function enumerated(nodes, name)
  local node = last(nodes, name)
  if not node then return "" end
  local number = signed(node.low)
  return " " .. (node.field.names[number] or string.format("%s %d", name, number))
end

local function counter_text(nodes, name)
  local node = last(nodes, name)
  return node and string.format("#%.0f", node.low) or "#?"
end

local function parts_of(node)
  local names = {}
  for _, inner in ipairs(node and node.nodes or {}) do
    local name = inner.field and inner.field.name
    if name and names[#names] ~= name then names[#names + 1] = name end
  end
  return #names > 0 and ": " .. table.concat(names, ", ") or ""
end

local function fri_column(nodes, header, identifier)
  local number = counter_text(header, "sequence_counter")
  if identifier == FRI_MONITORING_IDENTIFIER then
    local connection = last(nodes, "connection")
    connection = connection and connection.nodes
    return "FRI monitoring " .. number .. enumerated(connection, "session_state") .. enumerated(connection, "quality")
  end
  local answered = counter_text(header, "reflected_sequence_counter")
  return "FRI command " .. number .. " answers " .. answered .. parts_of(last(nodes, "command"))
end

local function dissect_fri(tvb, pinfo, tree)
  local raw = tvb:raw()
  local framed = is_known(fri_identifier(raw, 4))
    or #raw >= 8 and little_endian(raw, 0) + 8 == tvb:reported_len() and not is_known(fri_identifier(raw, 0))
  local identifier = fri_identifier(raw, framed and 4 or 0)
  local branch = tree:add(fri.proto, tvb())
  local problems, from, stop, note = {}, 0, #raw, ""
  if framed then
    from = 4
    stop, note = add_frame(branch, tvb, raw, problems)
  end
  local column
  if is_known(identifier) then
    local message = identifier == FRI_MONITORING_IDENTIFIER and FRI_MONITORING or FRI_COMMAND
    local nodes = parse(message, raw, from, stop, problems)
    local header = last(nodes, "header")
    header = header and header.nodes
    add_nodes(branch, tvb, fri, nodes)
    column = fri_column(nodes, header, identifier)
    local counter = last(header, message == FRI_MONITORING and "sequence_counter" or "reflected_sequence_counter")
    if counter and not pinfo.visited then
      local note_down = message == FRI_MONITORING and remember or find_answered
      note_down(pinfo, counter.low)
    end
    add_answered(branch, pinfo)
  else
    local what = identifier and string.format("the unknown message identifier 0x%x", identifier) or "no message identifier"
    problems[1] = {at = from, text = what .. ", so this is no message of FRI"}
    column = "FRI ?"
  end
  note = note .. add_problems(branch, tvb, fri, problems)
  branch:append_text(", " .. column:gsub("^FRI ", "") .. note)
  pinfo.cols.protocol:set("FRI")
  pinfo.cols.info:set(column .. note)
end

-- The servo link: one byte of framing, a packet, and a tag where there is a pre-shared key.

local servo = make_protocol("servo", "fri-hil servo link", {SERVO_PACKET}, {
  framing = ProtoField.uint8("servo.framing", "Framing", base.HEX, {[SERVO_BARE] = "no tag", [SERVO_TAGGED] = "tag"}),
  tag = ProtoField.bytes("servo.tag", "Tag (BLAKE2b, not checked)"),
})
servo.proto.experts = {servo.malformed}

local function packet_end(raw)
  return raw:byte(1) == SERVO_TAGGED and #raw - SERVO_TAG_BYTES or #raw
end

-- The protocol version of a packet; nil where there is no header that says one.
local function servo_version(raw)
  local framing = raw:byte(1)
  if framing ~= SERVO_BARE and framing ~= SERVO_TAGGED then return nil end
  if raw:byte(2) ~= 0x0A or raw:byte(4) ~= 0x08 then return nil end
  local low, high = read_varint(raw, 4, packet_end(raw))
  return low and low > 0 and high == 0 and low or nil
end

-- Whether the bytes are fields of a packet from the first to the last: a header and one body.
local function is_servo(raw)
  if not servo_version(raw) then return false end
  local at, stop, bodies = 1, packet_end(raw), 0
  while at < stop do
    local tag = raw:byte(at + 1)
    local field = tag % 8 == 2 and SERVO_PACKET.fields[(tag - 2) / 8]
    local found, to
    if field then found, to = measure(raw, 2, at + 1, stop) end
    if not found then return false end
    if at > 1 then bodies = bodies + 1 end
    at = to
  end
  return bodies == 1
end

local function text_of(tvb, nodes, name)
  local node = last(nodes, name)
  return node and node.to > node.at and plain(tvb:raw(node.at, node.to - node.at)) or ""
end

local function fixed_text(tvb, nodes, name)
  local node = last(nodes, name)
  return node and tostring(tvb(node.at, 8):le_uint64()) or "0"
end

local function name_of(nodes, name)
  local node = last(nodes, name)
  local number = node and signed(node.low) or 0
  local field = node and node.field
  return field and field.names and field.names[number] or string.format("%d", number)
end

local function what_of(nodes, name)
  local kinds = {}
  for _, node in ipairs(nodes) do
    if node.field and node.field.name == name then
      local kind = "?"
      for _, inner in ipairs(node.nodes) do
        if inner.nodes then kind = inner.field.name end
      end
      kinds[#kinds + 1] = kind
    end
  end
  return #kinds > 0 and ": " .. table.concat(kinds, ", ") or ""
end

local function numbered(tvb, header)
  return "#" .. fixed_text(tvb, header, "sequence")
end

local function reflecting(tvb, header)
  return numbered(tvb, header) .. " reflects #" .. fixed_text(tvb, header, "reflected_sequence")
end

local SERVO_COLUMNS = {
  hello = function(tvb, _, body) return name_of(body, "role") .. " " .. text_of(tvb, body, "name") end,
  welcome = function(tvb, _, body) return text_of(tvb, body, "software") .. " " .. text_of(tvb, body, "robot") end,
  refused = function(tvb, _, body) return text_of(tvb, body, "reason") end,
  ended = function(tvb, _, body) return text_of(tvb, body, "reason") end,
  goodbye = function(tvb, header) return numbered(tvb, header) end,
  command = function(tvb, header, body) return reflecting(tvb, header) .. what_of(body, "request") end,
  state = function(tvb, header, body)
    local snapshot = last(body, "snapshot")
    local cycle = snapshot and " cycle " .. fixed_text(tvb, snapshot.nodes, "cycle") or ""
    return reflecting(tvb, header) .. cycle .. what_of(body, "report")
  end,
}

local function servo_column(tvb, nodes)
  local header = last(nodes, "header")
  header = header and header.nodes or {}
  for index = #nodes, 1, -1 do
    local node = nodes[index]
    local describe = node.field and SERVO_COLUMNS[node.field.name]
    if describe then return "servo " .. node.field.name .. " " .. describe(tvb, header, node.nodes) end
  end
  return "servo ?"
end

local function dissect_servo(tvb, pinfo, tree)
  local raw = tvb:raw()
  local branch = tree:add(servo.proto, tvb())
  local problems, column, note = {}, "servo ?", ""
  local version, framing, stop = servo_version(raw), raw:byte(1), packet_end(raw)
  branch:add(servo.handles.framing, tvb(0, 1))
  if version then
    local nodes = parse(SERVO_PACKET, raw, 1, stop, problems, version ~= SERVO_VERSION)
    add_nodes(branch, tvb, servo, nodes)
    column = servo_column(tvb, nodes)
    if version ~= SERVO_VERSION then note = string.format(" [version %.0f: only what is frozen is read]", version) end
  elseif framing ~= SERVO_BARE and framing ~= SERVO_TAGGED then
    problems[1] = {at = 0, text = string.format("no packet of the servo link begins with 0x%02x", framing)}
  else
    problems[1] = {at = math.min(1, #raw - 1), text = "no protocol version"}
  end
  if framing == SERVO_TAGGED and stop > 1 then branch:add(servo.handles.tag, tvb(stop)) end
  note = note .. add_problems(branch, tvb, servo, problems)
  branch:append_text(", " .. column:gsub("^servo ", "") .. note)
  pinfo.cols.protocol:set("servo")
  pinfo.cols.info:set(column .. note)
end

-- Ports can be chosen freely on both links, so that one may stand on the usual port of the other.
function fri.proto.dissector(tvb, pinfo, tree)
  local raw = tvb:raw()
  if #raw == 0 then return 0 end
  local dissect = is_servo(raw) and not is_fri(raw) and dissect_servo or dissect_fri
  dissect(tvb, pinfo, tree)
end

function servo.proto.dissector(tvb, pinfo, tree)
  local raw = tvb:raw()
  if #raw == 0 then return 0 end
  local dissect = is_fri(raw) and not is_servo(raw) and dissect_fri or dissect_servo
  dissect(tvb, pinfo, tree)
end

register(fri, FRI_PORTS, "FRI", is_fri)
register(servo, SERVO_PORTS, "of the servo link", is_servo)
