"""The viser server that nobody has opened a page of, as in the tests of the view."""

from tests.view.conftest import server

__all__ = ["server"]
