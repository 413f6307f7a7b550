"""Computation of the chunks of a survey on a Dask cluster, with bit-identical results.

The machines of the cluster need katana450 in this version and the same numpy. Each chunk then runs
through the same code everywhere, and the results are joined in order.
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
"""[s] Timeout for the answer of the scheduler, and again for a first worker."""

CLOSE_SECONDS = 1.0
"""[s] Timeout for closing the connection to the scheduler."""


class Cluster:
    """A connection to a scheduler with compatible workers."""

    def __init__(self, client: Any, distributed: Any, address: str) -> None:
        """Use ``client`` of the module ``distributed`` at ``address``."""
        self._client = client
        self._distributed = distributed
        self._address = address

    def counts(self, survey: Survey, chunks: list[range]) -> Iterator[tuple[int, IntArray]]:
        """Yield the number of each chunk with its counts, in order of completion.

        Raises ConfigurationError if the cluster cannot finish.
        """
        futures = self._client.map(survey.count, chunks, pure=False)
        numbers = {future: number for number, future in enumerate(futures)}
        try:
            for future, counts in self._distributed.as_completed(
                futures, with_results=True, loop=self._client.loop
            ):
                # A result lost with the scheduler arrives as an exception.
                if isinstance(counts, BaseException):
                    raise counts
                yield numbers[future], counts
        except (Exception, CancelledError) as error:
            raise ConfigurationError(
                f"The cluster at {self._address} could not finish: {_reason(error)}. See the "
                "logs of its scheduler and workers."
            ) from error


@contextmanager
def connect_cluster(address: str) -> Iterator[Cluster]:
    """Connect to the scheduler at ``address``, such as tcp://10.0.0.1:8786.

    Raises ConfigurationError if the scheduler does not answer, has no workers, or has workers of
    another version.
    """
    distributed: Any = import_module("distributed")
    # Failures are reported once, as a ConfigurationError.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        # A client takes long to give up, so the address is tested first.
        socket.create_connection(
            distributed.comm.get_address_host_port(address), CONNECT_SECONDS
        ).close()
        client = distributed.Client(address, timeout=CONNECT_SECONDS, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ConfigurationError(
            f"No Dask scheduler answers at {address!r}: {_reason(error)}. Give an address such as "
            "tcp://10.0.0.1:8786, and check that `dask scheduler` runs there."
        ) from error
    try:
        _check_workers(client, address)
        yield Cluster(client, distributed, address)
    finally:
        # A timeout of a lost scheduler is not an error here.
        with suppress(TimeoutError):
            client.close(timeout=CLOSE_SECONDS)


def _check_workers(client: Any, address: str) -> None:
    try:
        client.wait_for_workers(1, timeout=CONNECT_SECONDS)
    except TimeoutError:
        raise ConfigurationError(
            f"The Dask scheduler at {address} has no workers. Start one with "
            f"`dask worker {address}`."
        ) from None
    own = _fingerprint()
    for worker, found in client.run(_fingerprint, on_error="return").items():
        if isinstance(found, BaseException):
            raise ConfigurationError(
                f"The Dask worker {worker} cannot run katana450: {_reason(found)}. Install "
                "katana450 in the worker's environment."
            )
        for what, mine in own.items():
            if found[what] != mine:
                raise ConfigurationError(
                    f"The Dask worker {worker} has {what} {found[what]}, but this machine {mine}. "
                    "Install the same, or the results would differ."
                )


def _fingerprint() -> dict[str, str]:
    """Return everything on which the bits of a result depend."""
    return {
        "katana450": version(),
        "numpy": np.__version__,
        "the processor family": platform.machine(),
    }


def _reason(error: BaseException) -> str:
    return str(error).strip().rstrip(".") or type(error).__name__
