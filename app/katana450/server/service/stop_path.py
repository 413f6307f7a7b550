"""Second path of STOP, as the front end knows it: its port, and whether it answers."""

from __future__ import annotations

from dataclasses import dataclass
from urllib.parse import urlsplit


@dataclass
class StopPath:
    """The port that serves STOP alone.

    Attributes:
        port: Port to which clients also send STOP; None if they have only the address of a proxy,
            or if there is no such port.
        main_port: Port of the page.
        secure: Whether both ports use TLS.
        problem: Problem of the path in words; empty if it answers.
    """

    port: int | None = None
    main_port: int = 0
    secure: bool = False
    problem: str = ""

    def port_beside(self, host: str) -> int | None:
        """Return the port for a page at ``host``, of its Host header; None if it cannot use one.

        A page at another port than the main one has come through a forwarded port.
        """
        used = urlsplit(f"//{host}").port or (443 if self.secure else 80)
        return self.port if used == self.main_port else None

    def origin_beside(self, host: str) -> str | None:
        """Return the origin to which a page at ``host`` may also send STOP; None without one.

        A content security policy cannot name an IPv6 address.
        """
        name, port = urlsplit(f"//{host}").hostname, self.port_beside(host)
        if port is None or name is None or ":" in name:
            return None
        return f"{'https' if self.secure else 'http'}://{name}:{port}"
