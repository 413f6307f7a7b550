"""Base class of what answers requests in place of the core."""

from __future__ import annotations

from argparse import Namespace
from typing import TYPE_CHECKING, Any, ClassVar

from katana450.arm.control import commands as cmd
from katana450.arm.control.act import Request
from katana450.server.api import answers

if TYPE_CHECKING:
    from katana450.server.service.hub import Hub
    from katana450.server.service.participants import Participant


class RequestHandler:
    """Answers requests of some classes. Its methods are called in the server's thread.

    Attributes:
        request_types: Classes of the requests that ``handle`` answers, of the API or of its own.
    """

    request_types: ClassVar[tuple[type[Request], ...]] = ()

    def __init__(self, hub: Hub, options: Namespace) -> None:
        """Create a handler for ``hub``. ``options``: those of ``katana450 serve``."""
        self.hub = hub
        self.options = options

    def handle(self, participant: Participant, request: Request) -> answers.Answer | cmd.Command:  # noqa: ARG002
        """Execute ``request``, one of ``request_types``, and return its answer.

        The dispatcher submits a returned command in the name of ``participant``, and answers with
        its outcome. Raises LeaseError and InputError with the reason for a refusal.
        """
        kind = type(request).__name__
        raise AssertionError(f"{type(self).__name__} lists {kind} and does not execute it.")

    def page_status(self, participant: Participant) -> dict[str, Any]:  # noqa: ARG002
        """Return its entries in the status of the page of ``participant``."""
        return {}
