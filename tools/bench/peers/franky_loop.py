"""Cycles of franky-sim in this thread, as fast as they go. Runs in the environment of the peers, and writes JSON.

Twice the same work. ``bare``: from the bytes of a command to the bytes of the state that is ready to be sent, through
the functions its own loop calls, without sockets; that is what ``hil bench cycle`` measures of ours. ``loop``: its own
loop, ``run_once(realtime=False)``, with a client over loopback that is not measured.
"""

import argparse
import json
from pathlib import Path
from typing import Any, Final

from franky_sim import SimulationServer
from franky_sim.franka_robot_protocol import MoveCommandControllerMode, MoveCommandMotionGeneratorMode
from franky_sim.mujoco_simulator import MujocoSimulator

from hil.clock import elapsed_ns
from tools.bench.peers import franka_wire
from tools.bench.peers.franka_client import FrankaClient
from tools.bench.peers.sine import AXIS, with_sine

_MOTION: Final = 1
_NO_COUNTER: Final = bytes(8)


def _bare(cycles: int, warm_up: int) -> dict[str, Any]:
    with MujocoSimulator() as simulator:
        robot = simulator.add_robot()
        with SimulationServer(simulator) as server:
            [robot_server] = server.robot_servers
            robot_server.process_commands()
            simulator.step()
            robot_server.start_motion(
                MoveCommandControllerMode.kJointImpedance, MoveCommandMotionGeneratorMode.kJointPosition, _MOTION
            )
            samples, states = [], []
            for command in _commands(tuple(robot.inner_state.q), 1, warm_up + cycles):
                before_ns = elapsed_ns()
                # What process_commands() and send_state() do, but for asking the sockets.
                robot_server._pre_process_commands()
                robot_server._handle_udp_command(command)
                robot_server._post_process_commands()
                simulator.step()
                state = robot_server._get_state_bytes()
                samples.append(elapsed_ns() - before_ns)
                states.append(_NO_COUNTER + state)
    return {"samples_ns": samples[warm_up:], "moved_rad": _moved_rad(states)}


def _loop(cycles: int, warm_up: int) -> dict[str, Any]:
    with MujocoSimulator() as simulator:
        robot = simulator.add_robot()
        with SimulationServer(simulator) as server, FrankaClient(robot.hostname) as client:
            server.run_once(realtime=False)
            client.ask_to_move()
            state, sender = client.receive()
            while not client.has_begun_to_move():
                server.run_once(realtime=False)
                state, sender = client.receive()
            samples, states = [], []
            first = franka_wire.state_counter(state)
            for command in _commands(franka_wire.measured_position_rad(state), first, warm_up + cycles):
                client.send(command, sender)
                before_ns = elapsed_ns()
                server.run_once(realtime=False)
                samples.append(elapsed_ns() - before_ns)
                state, sender = client.receive()
                states.append(state)
    return {"samples_ns": samples[warm_up:], "moved_rad": _moved_rad(states)}


def _commands(start_rad: tuple[float, ...], first: int, cycles: int) -> list[bytes]:
    """Return the answers to that many states, numbered from ``first``; made beforehand, as ours are."""
    return [franka_wire.position_command(first + cycle, with_sine(start_rad, cycle)) for cycle in range(cycles)]


def _moved_rad(states: list[bytes]) -> float:
    axis_rad = [franka_wire.measured_position_rad(state)[AXIS] for state in states]
    return max(axis_rad) - min(axis_rad)


def main() -> None:
    """Measure both and write them to a file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cycles", type=int, required=True)
    parser.add_argument("--warm-up", type=int, required=True)
    parser.add_argument("--out", type=Path, required=True)
    asked = parser.parse_args()
    found = {"bare": _bare(asked.cycles, asked.warm_up), "loop": _loop(asked.cycles, asked.warm_up)}
    asked.out.write_text(json.dumps(found), encoding="utf-8")


if __name__ == "__main__":
    main()
