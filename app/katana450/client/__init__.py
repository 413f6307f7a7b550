"""Clients for programs that drive the arm: ``from katana450.client import connect``."""

from katana450.client.asynchronous import AsyncClient, aconnect
from katana450.client.client import Client, connect
from katana450.client.files import RefusedError

__all__ = ["AsyncClient", "Client", "RefusedError", "aconnect", "connect"]
