"""Access links: their names, roles and expiries, and the secret that signs them.

All of this is in one file that only its owner can read. A link holds a signed token with a number
and an expiry. The grant of the number is in the file, so deleting it there ends the link at once.
"""

from __future__ import annotations

import logging
import math
import os
import secrets
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import msgspec
from itsdangerous import BadSignature, URLSafeSerializer

from katana450.arm.control.lease import Role
from katana450.atomic import write_files, writer_of
from katana450.errors import ConfigurationError, InputError
from katana450.platform_support import claim_file, open_bytes, readable_by_others

log = logging.getLogger(__name__)

SALT, SESSION_SALT = "katana450 access link", "katana450 session of a browser"
"""Purposes of the signatures: a cookie is no link, and a link is no cookie."""

MAX_NAME_LENGTH = 40
MAX_TOKEN_LENGTH = 400

T = TypeVar("T")

LOCK_TIMEOUT, LOCK_INTERVAL = 5.0, 0.02
"""[s] Timeout of a change of the file while another process changes it, and interval of the
attempts."""


class Grant(msgspec.Struct, frozen=True):
    """Rights of one link. Further fields, which earlier versions wrote, are ignored.

    Attributes:
        name: Name of the person.
        role: Role of the person.
        expires: End of the validity [s since the epoch].
    """

    name: str
    role: Role
    expires: float


class _Content(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    secret: str
    grants: dict[str, Grant]


@dataclass
class AccessFile:
    """The links that were given out. The file is read again whenever it has changed.

    If the file becomes unreadable while it is in use, the last links read stay valid.
    """

    path: Path
    _failure: str | None = field(default=None, repr=False)
    # Assigned together, because several threads read the file.
    _known: tuple[tuple[int, int, int] | None, _Content] = field(
        default=(None, _Content("", {})), repr=False
    )

    @classmethod
    def open(cls, path: Path) -> AccessFile:
        """Open an existing file. Raises ConfigurationError with what to do if that fails."""
        file = cls(path)
        file._refresh()
        return file

    @classmethod
    def create(cls, path: Path) -> AccessFile:
        """Open a file; create it with a new secret if it does not exist."""
        file = cls(path)
        with file._locked():
            if not path.exists():
                file._write(_Content(secrets.token_urlsafe(32), {}))
        return cls.open(path)

    @property
    def grants(self) -> dict[str, Grant]:
        """Grants by number, including expired ones."""
        return dict(self._refresh().grants)

    def give(self, name: str, role: Role, expires: float) -> str:
        """Return a token for a new link, valid until ``expires`` [s since the epoch].

        Raises InputError for an invalid name.
        """
        if not (name.isprintable() and 0 < len(name) <= MAX_NAME_LENGTH):
            raise InputError(f"A name needs 1 to {MAX_NAME_LENGTH} printable characters.")
        number = secrets.token_hex(8)
        with self._changing() as grants:
            grants[number] = Grant(name, role, expires)
        return str(self._signer().dumps([number, expires]))

    def session(self, number: str) -> str:
        """Return the cookie of a browser that signs in with the link of ``number``.

        It is valid as long as the link, and is no link itself: it cannot be passed on as one.
        """
        return str(self._signer(SESSION_SALT).dumps([number, secrets.token_hex(8)]))

    def revoke(self, number: str) -> Grant:
        """Delete the link of ``number``; return its grant. Raises InputError if there is none."""
        with self._changing() as grants:
            if number in grants:
                return grants.pop(number)
            raise InputError(f"There is no link {number!r}; `katana450 access list` shows them.")

    def check(self, token: str, now: float) -> tuple[str, Grant] | None:
        """Return number and grant of a token valid at ``now`` [s since the epoch], or None."""
        signed = self._signed(token, SALT, tuple[str, float])
        return None if signed is None else self._granted(signed[0], now, signed[1])

    def check_session(self, cookie: str, now: float) -> tuple[str, Grant] | None:
        """Return number and grant of the link of a ``cookie``, as ``check`` does of a token."""
        signed = self._signed(cookie, SESSION_SALT, tuple[str, str])
        return None if signed is None else self._granted(signed[0], now)

    def _signed(self, text: str, salt: str, kind: type[T]) -> T | None:
        """Return the value of type ``kind`` that ``text`` holds, signed for the purpose ``salt``.

        None without a valid signature.
        """
        if len(text) > MAX_TOKEN_LENGTH:
            return None
        self._refresh_or_keep()
        try:
            # itsdangerous compares signatures in constant time.
            return msgspec.convert(self._signer(salt).loads(text), kind)
        except (BadSignature, msgspec.ValidationError):
            return None

    def _granted(
        self, number: str, now: float, expires: float = math.inf
    ) -> tuple[str, Grant] | None:
        grant = self._known[1].grants.get(number)
        if grant is None or not now < min(expires, grant.expires):
            return None
        return number, grant

    def _signer(self, salt: str = SALT) -> URLSafeSerializer:
        return URLSafeSerializer(self._known[1].secret, salt=salt)

    def _refresh_or_keep(self) -> None:
        """Read the file again. If that fails, log it once; the last links read stay valid."""
        try:
            self._refresh()
        except ConfigurationError as error:
            if self._failure != str(error):
                self._failure = str(error)
                log.error("The last links that could be read stay valid. %s", error)
        else:
            self._failure = None

    def _refresh(self) -> _Content:
        """Return the present content. Raises ConfigurationError."""
        try:
            status = self.path.stat()
        except OSError as error:
            raise ConfigurationError(
                f"The access file {self.path} cannot be read: {error.strerror}. "
                "`katana450 access give --file PATH` makes one."
            ) from error
        read_at = (status.st_mtime_ns, status.st_size, status.st_ino)
        known_at, content = self._known
        if read_at == known_at:
            return content
        if readable_by_others(status):
            raise ConfigurationError(
                f"Other users can read the access file {self.path}. Run `chmod 600 {self.path}`. "
                "If it may have been read, delete it and give new links."
            )
        try:
            content = msgspec.json.decode(self.path.read_bytes(), type=_Content)
        except (OSError, msgspec.MsgspecError) as error:
            raise ConfigurationError(f"{self.path} is not an access file: {error}") from error
        self._known = read_at, content
        return content

    @contextmanager
    def _changing(self) -> Iterator[dict[str, Grant]]:
        """Yield the grants, and write them after the ``with`` block. Raises InputError.

        No other process and no other thread changes the file meanwhile.
        """
        with self._locked():
            content = self._refresh()
            grants = dict(content.grants)
            yield grants
            self._write(_Content(content.secret, grants))

    @contextmanager
    def _locked(self) -> Iterator[None]:
        """Hold the lock file beside the file inside the ``with`` block. Raises InputError."""
        path = self.path.with_name(f".{self.path.name}.lock")
        try:
            descriptor = open_bytes(path, os.O_RDWR | os.O_CREAT, 0o600)
        except OSError as error:
            raise InputError(f"{path} cannot be written: {error.strerror or error}.") from error
        try:
            _claim(descriptor, path)
            yield
        finally:
            os.close(descriptor)

    def _write(self, content: _Content) -> None:
        data = msgspec.json.format(msgspec.json.encode(content), indent=1) + b"\n"
        write_files({self.path: writer_of(data)}, mode=0o600)
        self._refresh()


def _claim(descriptor: int, path: Path) -> None:
    """Wait for the lock. Raises InputError after ``LOCK_TIMEOUT``."""
    end = time.monotonic() + LOCK_TIMEOUT
    while True:
        try:
            claim_file(descriptor)
        except OSError as error:
            if time.monotonic() > end:
                why = f"Another process keeps {path} locked. End it, or try again."
                raise InputError(why) from error
        else:
            return
        time.sleep(LOCK_INTERVAL)
