"""The viser server without any page, as in the tests of the view."""

from tests.view.conftest import server

__all__ = ["server"]
