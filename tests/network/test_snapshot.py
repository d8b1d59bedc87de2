"""A picture of a running controller's arm: where it is, not where it began."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from hil.client.servo import PTP, ServoClient
from tests.support.cli import cli
from tests.support.off_screen import no_picture_here
from tests.support.processes import finish, hil, own_host, wait_for_line

NO_PICTURE = no_picture_here()
POSITION = (0.2, 0.5, 0.0, 0.9, 0.0, 1.2, 0.0)


@pytest.mark.skipif(bool(NO_PICTURE), reason=NO_PICTURE)
def test_the_arm_is_drawn_where_the_controller_says(tmp_path: Path) -> None:
    host, station = own_host(), tmp_path / "s.toml"
    station.write_text(
        f'pad = "off"\n[[robot]]\nname = "a"\nbackend = "ideal"\nmodel = "lbr-med-7"\n'
        f'[robot.servo]\nbind = "{host}:30300"\n'
    )
    process = hil("run", station, station_links=True)
    wait_for_line(process, f"applications at {host}")
    with ServoClient(f"{host}:30300") as robot:
        robot.move(PTP(POSITION))
        pictures = []
        wanted: tuple[list[object], ...] = (
            [station, "--live"],
            ["--controller", f"{host}:30300"],
            ["--robot", "lbr-med-7", "--position", " ".join(map(str, np.degrees(POSITION)))],
            ["--robot", "lbr-med-7"],
        )
        for number, arguments in enumerate(wanted):
            file = tmp_path / f"{number}.png"
            ended = cli("snapshot", "-o", file, "--size", "120x120", *arguments)
            assert ended.code == 0, ended.err
            pictures.append(imread(str(file)))
        ended = cli("snapshot", "-o", file, "--controller", f"{host}:30300", "--robot", "lbr-med-14")
        assert ended.code == 2
        assert f"the controller at {host}:30300 has a lbr-med-7, and not a lbr-med-14" in ended.err
    assert finish(process, interrupt=True).code == 0
    of_station, of_controller, told, initial = pictures
    assert np.abs(of_station - told).mean() < 1e-3
    assert np.abs(of_controller - told).mean() < 1e-3
    assert np.abs(initial - told).mean() > 1e-2
