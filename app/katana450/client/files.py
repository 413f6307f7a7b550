"""Upload and download of files over HTTP; they are too large for a message."""

from __future__ import annotations

import urllib.error
import urllib.request
from dataclasses import dataclass, replace
from urllib.parse import urlencode, urlsplit

import msgspec

from katana450.errors import KatanaError
from katana450.server.api import answers
from katana450.server.api.fields import ROOT

STOP_TIMEOUT = 2.0
"""[s] Timeout of a STOP on one path."""

REQUEST_TIMEOUT = 60.0
"""[s] Timeout of a transfer."""


class RefusedError(KatanaError):
    """The server refused the request; the message says why, and what to do."""


class LostError(KatanaError):
    """The connection to the server is lost. A moving arm is then stopped."""


@dataclass(frozen=True)
class Site:
    """The address of the server, the token of an access link if it requires one, and our name."""

    url: str
    token: str = ""
    name: str = "Program"

    def mesh(self, data: bytes, name: str, unit: str | None) -> answers.Mesh:
        """See ``AsyncClient.upload``."""
        query = {"name": name} | ({} if unit is None else {"unit": unit})
        answer = answers.decoded(self._ask(f"{ROOT}/mesh?{urlencode(query)}", data))
        assert isinstance(answer, answers.Mesh)
        return answer

    def scene(self, data: bytes) -> answers.Scene:
        """See ``AsyncClient.load_scene``."""
        answer = answers.decoded(self._ask(f"{ROOT}/scene", data))
        assert isinstance(answer, answers.Scene)
        return answer

    def saved(self) -> bytes:
        """See ``AsyncClient.save_scene``."""
        return self._ask(f"{ROOT}/scene", None)

    def fetched(self, path: str, data: bytes | None = None) -> bytes:
        """Return the content at ``path``, the answer to ``data`` if that is sent.

        Raises RefusedError or LostError.
        """
        name = self.name if self.name.isascii() else "Program"
        return self._ask(path, data, {"X-Name": name})

    def recording(self, last: float) -> bytes:
        """See ``AsyncClient.recording``."""
        return self._ask(f"{ROOT}/recording?{urlencode({'last': last})}", None)

    def stop(self, press: str, port: int | None = None) -> str:
        """Send STOP over HTTP; return whether the arm has ``confirmed`` it, or ``requested``.

        Args:
            press: name of the press, which counts once on all paths.
            port: port that serves STOP alone; None for that of the server.

        Raises:
            RefusedError: the server does not admit the program.
            LostError: nothing answers on this port.
        """
        site = self
        if port is not None:
            parts = urlsplit(self.url)
            host = f"[{parts.hostname}]" if ":" in (parts.hostname or "") else parts.hostname
            site = replace(self, url=f"{parts.scheme}://{host}:{port}")
        path = f"{ROOT}/stop?{urlencode({'press': press})}"
        # A header has no other characters.
        name = self.name if self.name.isascii() else "Program"
        content = site._ask(path, b"", {"X-Name": name}, STOP_TIMEOUT)
        # The server of STOP alone answers with the stage.
        return str(msgspec.json.decode(content)["stop"]) if content else "requested"

    def _ask(
        self,
        path: str,
        data: bytes | None,
        headers: dict[str, str] | None = None,
        timeout: float = REQUEST_TIMEOUT,
    ) -> bytes:
        headers = dict(headers or {})
        if self.token:
            headers["Authorization"] = f"Bearer {self.token}"
        request = urllib.request.Request(self.url.rstrip("/") + path, data=data, headers=headers)
        try:
            with urllib.request.urlopen(request, timeout=timeout) as answer:
                content: bytes = answer.read()
                return content
        except urllib.error.HTTPError as error:
            with error:
                raise RefusedError(_why(error.read())) from error
        except OSError as error:
            raise LostError(f"There is no katana450 server at {self.url}: {error}.") from error


def _why(content: bytes) -> str:
    try:
        refused = answers.decoded(content)
    except msgspec.MsgspecError:
        return content.decode("utf-8", "replace")
    return refused.why if isinstance(refused, answers.Refused) else str(refused)
