"""Steps of franka-sim in this thread, as fast as they go. Runs in the environment of that peer, and writes JSON.

Its cycle is spread over three threads, so there is no function that runs one. What is measured is the work of the two
that every cycle needs, by their public functions: the target, control law and MuJoCo step, and the state as bytes. Not
in it is what its threads do between these: reading the command, its checks of limits and of the connection.
"""

import argparse
import json
from pathlib import Path
from typing import Final

from franka_sim.control_modes import ControlMode
from franka_sim.mujoco_franka_sim import MujocoFrankaSim
from franka_sim.robot_state import RobotState

from hil.clock import elapsed_ns
from tools.bench.peers import franka_wire
from tools.bench.peers.sine import AXIS, with_sine

_SENT: Final = ("q", "dq", "q_d", "dq_d", "ddq_d", "tau_J", "O_T_EE")
"""What its server copies from the simulator into the packet when nobody owns it."""


def main() -> None:
    """Measure and write to a file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cycles", type=int, required=True)
    parser.add_argument("--warm-up", type=int, required=True)
    parser.add_argument("--out", type=Path, required=True)
    asked = parser.parse_args()
    simulator = MujocoFrankaSim()
    simulator.initialize_simulation()
    start_rad = tuple(float(position) for position in simulator.get_robot_state()["q"])
    simulator.update_joint_positions(start_rad)
    simulator.set_control_mode(ControlMode.POSITION)
    packet = RobotState()
    targets_rad = [with_sine(start_rad, cycle) for cycle in range(asked.warm_up + asked.cycles)]
    samples, states = [], []
    for target_rad in targets_rad:
        before_ns = elapsed_ns()
        simulator.update_joint_positions(target_rad)
        simulator.step()
        seen = simulator.get_robot_state()
        packet.state.update({field: seen[field] for field in _SENT})
        state = packet.pack_state()
        packet.update()
        samples.append(elapsed_ns() - before_ns)
        states.append(state)
    axis_rad = [franka_wire.measured_position_rad(state)[AXIS] for state in states]
    found = {"bare": {"samples_ns": samples[asked.warm_up :], "moved_rad": max(axis_rad) - min(axis_rad)}}
    asked.out.write_text(json.dumps(found), encoding="utf-8")


if __name__ == "__main__":
    main()
