"""The chunks of a survey on a Dask cluster, with the result of a single machine to the bit.

The cluster's machines need katana450 installed, in this version and with this numpy: the same
chunks then go through the same code everywhere, and what comes back is put together in order.
"""

from __future__ import annotations

import logging
import platform
import socket
from asyncio import CancelledError
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from typing import Any

import numpy as np

from katana450.cli.version import version
from katana450.errors import ConfigurationError
from katana450.extensions.reachability.grid import IntArray
from katana450.extensions.reachability.map import Survey

CONNECT_SECONDS = 5.0
"""For the scheduler to answer, and then for a first worker."""

CLOSE_SECONDS = 1.0
"""For the scheduler to take leave."""


class Cluster:
    """A connection to a scheduler that has workers fit for the task."""

    def __init__(self, client: Any, distributed: Any, address: str) -> None:
        self._client = client
        self._distributed = distributed
        self._address = address

    def counts(self, survey: Survey, chunks: list[range]) -> Iterator[tuple[int, IntArray]]:
        """The number of each chunk and its counts, as they come.

        Raises ConfigurationError when the cluster cannot finish.
        """
        futures = self._client.map(survey.count, chunks, pure=False)
        numbers = {future: number for number, future in enumerate(futures)}
        try:
            for future, counts in self._distributed.as_completed(
                futures, with_results=True, loop=self._client.loop
            ):
                # What was lost with the scheduler comes as the error that tells so.
                if isinstance(counts, BaseException):
                    raise counts
                yield numbers[future], counts
        except (Exception, CancelledError) as error:
            raise ConfigurationError(
                f"The cluster at {self._address} could not finish: {_said(error)}. See what its "
                "scheduler and workers logged."
            ) from error


@contextmanager
def connect_cluster(address: str) -> Iterator[Cluster]:
    """The cluster whose scheduler is at `address`, such as tcp://10.0.0.1:8786.

    Raises ConfigurationError when the scheduler does not answer, it has no workers, or they have
    another version of what counts.
    """
    distributed: Any = import_module("distributed")
    # What goes wrong is told as one error of ours.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        # A client that finds nobody takes long to give up, so see first who is there.
        socket.create_connection(
            distributed.comm.get_address_host_port(address), CONNECT_SECONDS
        ).close()
        client = distributed.Client(address, timeout=CONNECT_SECONDS, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ConfigurationError(
            f"No Dask scheduler answers at {address!r}: {_said(error)}. Give an address such as "
            "tcp://10.0.0.1:8786, and see that `dask scheduler` runs there."
        ) from error
    try:
        _check_workers(client, address)
        yield Cluster(client, distributed, address)
    finally:
        # A scheduler that is gone says no farewell; that is no new error.
        with suppress(TimeoutError):
            client.close(timeout=CLOSE_SECONDS)


def _check_workers(client: Any, address: str) -> None:
    try:
        client.wait_for_workers(1, timeout=CONNECT_SECONDS)
    except TimeoutError:
        raise ConfigurationError(
            f"The Dask scheduler at {address} has no workers; start one with "
            f"`dask worker {address}`."
        ) from None
    own = _fingerprint()
    for worker, found in client.run(_fingerprint, on_error="return").items():
        if isinstance(found, BaseException):
            raise ConfigurationError(
                f"The Dask worker {worker} cannot run katana450: {_said(found)}. Install katana450 "
                "in the worker's environment."
            )
        for what, mine in own.items():
            if found[what] != mine:
                raise ConfigurationError(
                    f"The Dask worker {worker} has {what} {found[what]} and this machine {mine}; "
                    "install the same, else the result would not be the same."
                )


def _fingerprint() -> dict[str, str]:
    """What the bits of a result depend on."""
    return {
        "katana450": version(),
        "numpy": np.__version__,
        "the processor family": platform.machine(),
    }


def _said(error: BaseException) -> str:
    return str(error).strip().rstrip(".") or type(error).__name__
