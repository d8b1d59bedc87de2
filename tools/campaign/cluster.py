"""Scenarios on a Dask cluster.

Its workers have this release of fri-hil, and the programs and captures at the same paths.
"""

import faulthandler
import re
from collections.abc import Iterable, Iterator
from itertools import islice
from typing import Any, Final

from hil.values.errors import BackendError, ConfigurationError, EndpointError
from hil.version import SOFTWARE
from tools.campaign.scenario import Row, Scenario, empty_row

_CONNECT_S: Final = 10
_IN_FLIGHT: Final = 4
"""Scenarios a thread of the cluster has waiting: enough that none idles, few enough to be bounded."""


def play_on_cluster(scenarios: Iterable[Scenario], *, scheduler: str, patience_s: float, retries: int) -> Iterator[Row]:
    """Yield a row for each scenario, as they end.

    A worker that dies costs its scenario a retry; one that takes longer than ``patience_s`` ends itself, so that its
    nanny starts another. Raises :class:`ConfigurationError` where ``distributed`` is not installed or the workers have
    another release, :class:`EndpointError` where no scheduler or no worker is there.
    """
    try:
        from distributed import Client, KilledWorker, as_completed
    except ImportError:
        raise ConfigurationError(
            "a Dask cluster needs the package distributed: pip install 'fri-hil[campaign]'"
        ) from None
    if re.search(r":\d+$", scheduler) is None:
        # Such a client would fail twice, the second time in a thread of its own.
        raise EndpointError(f"{scheduler!r} is no address of a Dask scheduler; tcp://HOST:PORT is one")
    try:
        client = Client(scheduler, timeout=_CONNECT_S, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise EndpointError(f"no Dask scheduler at {scheduler}: {error}") from error
    with client:
        threads = sum(_checked_threads(client, scheduler).values())
        waiting = iter(scenarios)
        playing: dict[Any, Scenario] = {}

        def hand_out(count: int) -> list[Any]:
            futures = []
            for scenario in islice(waiting, count):
                future = client.submit(_play_watched, scenario, patience_s, pure=False, retries=retries)
                playing[future] = scenario
                futures.append(future)
            return futures

        ended = as_completed(hand_out(_IN_FLIGHT * threads), loop=client.loop)
        for future in ended:
            scenario = playing.pop(future)
            try:
                yield future.result()
            except KilledWorker as error:
                yield empty_row(scenario, "worker-died", f"its workers died: {error}"[:500], attempts=retries + 1)
            except Exception as error:  # noqa: BLE001  # whatever failed over there failed for this scenario
                yield empty_row(scenario, "worker-died", f"{type(error).__name__}: {error}"[:500], attempts=retries + 1)
            for another in hand_out(1):
                ended.add(another)


def _checked_threads(client: Any, scheduler: str) -> dict[str, int]:
    try:
        client.wait_for_workers(1, timeout=_CONNECT_S)
    except TimeoutError:
        raise EndpointError(
            f"the Dask scheduler at {scheduler} has no workers: start some (dask worker {scheduler})"
        ) from None
    threads: dict[str, int] = client.nthreads()
    try:
        there: dict[str, str] = client.run(_software)
    except Exception as error:
        raise BackendError(f"a Dask worker of {scheduler} cannot run fri-hil: {error}") from error
    for worker, software in there.items():
        if software != SOFTWARE:
            raise ConfigurationError(f"the Dask worker {worker} has {software}, this is {SOFTWARE}: rows would differ")
    return threads


def _software() -> str:
    return SOFTWARE


def _play_watched(scenario: Scenario, patience_s: float) -> Row:
    """Play in a Dask worker; a scenario that hangs ends the worker, which nothing else could."""
    from hil.arithmetic import fix_arithmetic
    from tools.campaign.play import play

    fix_arithmetic()
    faulthandler.dump_traceback_later(patience_s, exit=True)
    try:
        return play(scenario)
    finally:
        faulthandler.cancel_dump_traceback_later()
