"""A client of another FRI release than the configured one, recognised from its answers, with the remedy."""

from typing import Final

from hil.values.finding import Finding, Severity, Whose
from hil.values.fri import TRAITS, Release

RELEASE_MIX_UP: Final = "release-mix-up"


def alike(release: Release) -> str:
    """Return a release with those that its packets do not tell it from: 1.11 to 1.16 are one on the wire."""
    return str(release) if TRAITS[release].pose else "1.x"


def undecodable_client(looks_like: Release, configured: Release, *, peer: str, detail: str) -> Finding:
    """The answers cannot be read as those of the configured release, and can as another one's."""
    spoken = alike(looks_like)
    return Finding(
        RELEASE_MIX_UP,
        Severity.FAULT,
        Whose.CONFIGURATION,
        f"the client at {peer} speaks {spoken}, the controller is configured for {configured}: none of its answers can "
        f"be used",
        evidence=(f"its answer: {detail}",),
        remedies=_remedies(looks_like, configured),
        figures={"configured": configured.value, "client": looks_like.value},
    )


def doubted_client(configured: Release, *, peer: str, echoes_positions: bool) -> Finding:
    """The answers can be read, but in monitoring they are not what clients of the configured release send."""
    looks_like = Release.V1_15 if echoes_positions else Release.V2_5
    what = "with positions" if echoes_positions else "with a header alone"
    return Finding(
        RELEASE_MIX_UP,
        Severity.WARNING,
        Whose.CONFIGURATION,
        f"the client at {peer} seems to speak {alike(looks_like)}, the controller is configured for {configured}: in "
        f"monitoring it answers {what}, which a {alike(configured)} client does not do by itself",
        remedies=_remedies(looks_like, configured),
        figures={"configured": configured.value, "client": looks_like.value},
    )


def _remedies(looks_like: Release, configured: Release) -> tuple[str, ...]:
    start = f"start the controller with --fri-version {looks_like}"
    if not TRAITS[looks_like].pose:
        start += " (or 1.11, 1.14, 1.16: the same on the wire but for inputs and outputs)"
    return start, f"or build the client with the FRI library of release {configured}"
