"""A controller and its client need no more memory for the hundredth motion than for the second: nothing grows."""

import gc
import sys

from hil.config.station import Reaction, ReactionConfig, RobotConfig, ServoConfig
from hil.core.motion.queue import REMEMBERED_ENDS
from hil.core.servo.link import SERVO_LINK
from hil.values.link import Address, Source
from hil.values.motion import MotionKind, MotionParameters
from hil.values.servo import SetDestination, StartMotion, StopMotion
from tools.bench.servo_virtual import VirtualApplication

GROWTH_BLOCKS_A_MOTION = 4
"""Python's own memory blocks. A motion that is kept takes 106; a number kept of each destination, 15 a motion."""
DESTINATIONS = 15


def run_motion(application: VirtualApplication, number: int) -> None:
    """Start a motion, send it to and fro while strangers talk, and stop it."""
    kind = MotionKind.SMART_SERVO if number % 2 else MotionKind.DIRECT_SERVO
    motion = application.ask(lambda request: StartMotion(request, kind, MotionParameters(), None)).request
    application.cycle()
    rest = application.snapshot.commanded_position
    for place in range(DESTINATIONS):
        goal = (rest[0] + 1e-4 * (1 - 2 * (place % 2)), *rest[1:])
        application.ask(lambda request, goal=goal: SetDestination(request, motion, goal))  # type: ignore[misc]
    stranger = Source(SERVO_LINK, Address("127.0.0.9", 1024 + number))
    application.controller.receive(b"who is there?", stranger, now_ns=application.now_ns)
    application.ask(lambda request: StopMotion(request, motion))
    application.run(0.02)


def used_blocks() -> int:
    gc.collect()
    return sys.getallocatedblocks()


def test_nothing_grows_with_motions_destinations_and_strangers() -> None:
    ideal = ReactionConfig(profile=Reaction.IDEAL)
    config = RobotConfig(backend="ideal", servo=ServoConfig(), reaction=ideal)
    with VirtualApplication(config) as application:
        # What is remembered, by a bound, must be full first.
        for number in range(REMEMBERED_ENDS + 6):
            run_motion(application, number)
        before = used_blocks()
        for number in range(REMEMBERED_ENDS):
            run_motion(application, number)
        assert used_blocks() - before < GROWTH_BLOCKS_A_MOTION * REMEMBERED_ENDS
        assert application.controller.motion.applications.started == 2 * REMEMBERED_ENDS + 6
