"""All targets, by name."""

from tests.fuzz import controller, decoders, files, sessions
from tests.fuzz.target import Target

TARGETS: dict[str, Target] = {
    target.name: target for target in (*decoders.TARGETS, *sessions.TARGETS, *controller.TARGETS, *files.TARGETS)
}
