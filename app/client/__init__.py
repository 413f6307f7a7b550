"""Programs that drive the arm begin here: ``from app.client import connect``."""

from app.client.asynchronous import AsyncClient, aconnect
from app.client.client import Client, connect
from app.client.files import RefusedError

__all__ = ["AsyncClient", "Client", "RefusedError", "aconnect", "connect"]
