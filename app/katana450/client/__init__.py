"""Clients for programs that drive the arm: ``from katana450.client import connect``."""

from katana450.client.client import AsyncClient, Client, aconnect, connect
from katana450.client.files import RefusedError

__all__ = ["AsyncClient", "Client", "RefusedError", "aconnect", "connect"]
