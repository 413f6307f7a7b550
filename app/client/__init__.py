"""Programs that drive the arm begin here: ``from app.client import connect``."""

from app.client.asynchronous import AsyncClient, RefusedError, aconnect
from app.client.client import Client, connect

__all__ = ["AsyncClient", "Client", "RefusedError", "aconnect", "connect"]
