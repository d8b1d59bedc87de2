"""Writes the four MJCF files of the robots from the facts table: ``python -m tools.make_robots``."""

from backends.robots import mjcf_path
from backends.robots.facts import ROBOTS
from backends.robots.mjcf import mjcf_text


def main() -> None:
    """Write every robot's file beside the facts table it is made from."""
    for facts in ROBOTS:
        path = mjcf_path(facts.description.name)
        path.write_text(mjcf_text(facts), encoding="utf-8")
        print(path)


if __name__ == "__main__":
    main()
