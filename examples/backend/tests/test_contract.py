"""What fri-hil expects of every robot side, and how this one is told what it is."""

import time
from collections.abc import Mapping

import pytest

from backends.contract import DrivesContract
from backends.registry import check_backend, make_backend
from backends.rig import InProcessRig, Rig
from backends.robots import load_description
from hil.values.backend import BackendRequest
from hil.values.errors import ConfigurationError


class TestElastic(DrivesContract):
    elapsed_ns = staticmethod(time.perf_counter_ns)
    options: Mapping[str, object] = {}

    def make_rig(self) -> Rig:
        request = BackendRequest(
            robot="arm", description=load_description("lbr-iiwa-7-r800"), cycle_ns=self.period_ns, options=self.options
        )
        return InProcessRig(make_backend("elastic", request))


class TestElasticAt4MsAndSoft(TestElastic):
    period_ns = 4_000_000
    options: Mapping[str, object] = {"frequency_hz": 6, "damping_ratio": 1.0}


@pytest.mark.parametrize("period_ns", [1_000_000, 4_000_000])
def test_on_a_steady_ramp_the_link_is_neither_behind_its_motor_nor_ahead(period_ns: int) -> None:
    suite = TestElastic()
    suite.period_ns = period_ns
    with suite.opened() as rig:
        told, state = suite.ramp(rig, 400)
        assert state.position_rad == pytest.approx(told, abs=1e-6)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"stiffness": 3}, "there is no 'stiffness'; valid: frequency_hz, damping_ratio"),
        ({"damping_ratio": 0}, "damping_ratio: Input should be greater than or equal to 0.05, got 0"),
        ({"frequency_hz": "soft"}, "frequency_hz: Input should be a valid number, got 'soft'"),
    ],
)
def test_options_that_cannot_be_are_refused_in_one_sentence(options: dict[str, object], sentence: str) -> None:
    with pytest.raises(ConfigurationError) as refused:
        check_backend("elastic", options)
    assert str(refused.value) == f"options of the backend elastic: {sentence}"
