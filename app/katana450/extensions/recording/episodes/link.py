"""The private connection from the page's server to the process that records.

The process that records listens in the private folder of the server. Address and key stand in a
file of the folder of episodes that only this user can read.
"""

from __future__ import annotations

import json
import logging
import secrets
import threading
import time
from contextlib import suppress
from multiprocessing import AuthenticationError
from multiprocessing.connection import (
    Client,
    Listener,
    answer_challenge,
    deliver_challenge,
)
from pathlib import Path
from typing import Any

from katana450.arm.runtime.guarded_pipe import GuardedPipe
from katana450.atomic import write_files, writer_of
from katana450.errors import InputError
from katana450.extensions.recording.episodes.episode import EpisodeGiver
from katana450.extensions.recording.episodes.episode_requests import episode_request
from katana450.extensions.recording.episodes.keeper import EpisodeKeeper
from katana450.extensions.recording.pseudonyms import Pseudonyms

SERVER_FILE = ".server.json"
"""Name of the file with the address of the process that records, and the key to it."""

IDLE_SECONDS = 60.0
"""[s] Maximum time between two states for a watcher while nothing changes."""

ACTIVE_SECONDS = 0.5
"""[s] Time between two states for a watcher while an episode runs."""

ACCEPT_SECONDS = 0.5
"""[s] Time after a connection that could not be accepted until the next one."""

GREETING_SECONDS = 5.0
"""[s] Maximum time for which a client waits until the process that records greets it."""

ANSWER_SECONDS = 300.0
"""[s] Maximum time for which a request waits for its answer, such as the saving of an hour."""

MAX_MESSAGE_BYTES = 64_000

READY_SECONDS = 15.0
"""[s] Maximum time for which the first episode waits for the process that records."""

NOT_READY = (
    "The process that records is not ready. It starts a few seconds after the arm; try it again."
)

log = logging.getLogger(__name__)


class NotReadyError(InputError):
    """Raised while no process records episodes."""


class EpisodeListener:
    """Accepts connections in the process that records, and answers their requests."""

    def __init__(
        self, keeper: EpisodeKeeper, folder: Path, address: str, port: int, salt: bytes
    ) -> None:
        """Listen at ``address`` for requests to ``keeper``.

        Args:
            keeper: executes the requests.
            folder: the folder of episodes.
            address: a socket file in a private folder, or the name of a pipe of Windows.
            port: port of the page, which names the server.
            salt: random bytes for the pseudonyms of people, as in the recording.

        Raises:
            InputError: the folder cannot be written.
            OSError: the address cannot be used.
        """
        self._keeper, self._pseudonyms = keeper, Pseudonyms(salt)
        self._key = secrets.token_bytes(32)
        # A process that was killed leaves its socket file.
        with suppress(OSError):
            Path(address).unlink()
        self._closed = False
        # Without a key: a client that stalls in its handshake must not keep others out.
        self._listener = Listener(address, backlog=8)
        text = json.dumps({"port": port, "address": address, "key": self._key.hex()}).encode()
        write_files({folder / SERVER_FILE: writer_of(text)}, mode=0o600)
        for work, name in ((self._accept, "episode requests"), (self._tick, "episode clock")):
            threading.Thread(target=work, name=name, daemon=True).start()

    def close(self) -> None:
        """Take no more requests."""
        self._closed = True
        # Its socket may be gone with the private folder of the server.
        with suppress(OSError):
            self._listener.close()

    def _accept(self) -> None:
        reported = ""
        while True:
            try:
                connection = self._listener.accept()
            except OSError as error:
                if self._closed:
                    return
                # As when too many files are open: later requests may be accepted.
                if reported != (reported := str(error)):
                    log.error("A request about episodes could not be accepted: %s.", error)
                time.sleep(ACCEPT_SECONDS)
                continue
            threading.Thread(
                target=self._serve, args=(connection,), name="episode request", daemon=True
            ).start()

    def _tick(self) -> None:
        """Let the keeper look at the time while an episode runs."""
        while True:
            self._keeper.wait(self._keeper.revision, ACTIVE_SECONDS if self._keeper.active else 5.0)
            try:
                self._keeper.tick()
            except Exception:
                # The next look must come, whatever happened.
                log.exception("The clock of the episodes met an error.")

    def _serve(self, connection: Any) -> None:
        with GuardedPipe(connection, "A connection about episodes"), suppress(AuthenticationError):
            deliver_challenge(connection, self._key)
            answer_challenge(connection, self._key)
            asked = json.loads(connection.recv_bytes(MAX_MESSAGE_BYTES))
            if asked.get("watch"):
                self._send_states(connection)
            else:
                connection.send_bytes(json.dumps(self._answer(asked)).encode())
        connection.close()

    def _send_states(self, connection: Any) -> None:
        """Send the state whenever it changes, until the other end closes."""
        keeper = self._keeper
        while True:
            revision = keeper.revision
            connection.send_bytes(json.dumps(keeper.status()).encode())
            keeper.wait(revision, ACTIVE_SECONDS if keeper.active else IDLE_SECONDS)

    def _answer(self, asked: dict[str, Any]) -> dict[str, Any]:
        by = asked["by"]
        giver = EpisodeGiver(by["name"], by["role"], self._pseudonyms.of(by["key"]))
        try:
            return {"done": self._keeper.handle(episode_request(asked["request"]), giver)}
        except InputError as error:
            return {"why": str(error)}
        except Exception as error:
            log.exception("A request about an episode met an error.")
            return {"why": f"The process that records met an error: {error}."}


def connect_to_episodes(folder: Path, port: int) -> Any:
    """Return a connection to the process that records episodes in ``folder``.

    ``port``: port of its server. Raises InputError while there is none.
    """
    try:
        found = json.loads((folder / SERVER_FILE).read_bytes())
        if found["port"] != port:
            raise InputError(
                f"The server on port {found['port']} uses the folder of episodes {folder}. Name "
                "another one by `serve --episodes FOLDER`."
            )
        return _greeted(found["address"], bytes.fromhex(found["key"]))
    except (OSError, EOFError, ValueError, KeyError, TypeError, AuthenticationError) as error:
        raise NotReadyError(NOT_READY) from error


def _greeted(address: str, key: bytes) -> Any:
    """Return a connection to ``address`` on which both ends have shown that they know ``key``."""
    connection: Any = Client(address)
    try:
        # A process that hangs accepts connections too.
        if not connection.poll(GREETING_SECONDS):
            raise EOFError("The process that records does not answer.")
        answer_challenge(connection, key)
        deliver_challenge(connection, key)
    except BaseException:
        connection.close()
        raise
    return connection


def request_episode(folder: Path, port: int, request: str, by: EpisodeGiver) -> dict[str, Any]:
    """Send ``request``, a JSON text, to the process that records; return the episode.

    Args:
        folder: folder of the episodes.
        port: port of the server.
        request: see ``episode_requests``.
        by: the sender, whose ``key`` becomes a pseudonym there.

    Raises:
        InputError: the request is refused, with the reason, or no process records.
    """
    connection = connect_to_episodes(folder, port)
    asked = {"request": request, "by": {"name": by.name, "role": by.role, "key": by.key}}
    try:
        connection.send_bytes(json.dumps(asked).encode())
        if not connection.poll(ANSWER_SECONDS):
            raise InputError(
                f"The process that records has not answered for {ANSWER_SECONDS:g} s. Look at the "
                "list of episodes, and start the server again if this repeats."
            )
        answer = json.loads(connection.recv_bytes(MAX_MESSAGE_BYTES))
    except (OSError, EOFError, ValueError) as error:
        raise InputError(
            "The process that records has ended. It is started again; look at the list of episodes."
        ) from error
    finally:
        connection.close()
    if "why" in answer:
        raise InputError(answer["why"])
    done: dict[str, Any] = answer["done"]
    return done
