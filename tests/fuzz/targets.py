"""All targets, by name."""

from tests.fuzz import controller, decoders, files, robot_sides, sessions
from tests.fuzz.target import Target

TARGETS: dict[str, Target] = {
    target.name: target
    for target in (
        *decoders.TARGETS,
        *sessions.TARGETS,
        *controller.TARGETS,
        *robot_sides.TARGETS,
        *files.TARGETS,
    )
}
