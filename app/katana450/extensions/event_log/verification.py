"""Verification of an event log: the chain of its records, its files and its head."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from katana450.errors import InputError
from katana450.extensions.event_log.folder import HEAD_NAME, LogHead, first_seq, log_files
from katana450.extensions.event_log.records import FIRST_HASH, Record, decoded, hash_of

MAX_READ_BYTES = 1_000_000
"""Maximum length of a line that is read at once; the writer's lines are much shorter."""

KEPT_HASHES = 1024
"""Number of records whose hashes are kept, to recognise records in the wrong order."""


@dataclass(frozen=True)
class StoredLine:
    """One line of a log. ``record`` is None if the line holds none."""

    path: Path
    number: int
    content: bytes
    ends: bool
    record: Record | None

    @property
    def place(self) -> str:
        """File and line, for messages."""
        return f"{self.path.name}, line {self.number}"


@dataclass
class LogReport:
    """Result of a verification.

    Attributes:
        files: number of files.
        records: number of records.
        first, last: the first and the last record.
        head: number and hash of the last record.
        faults: sentences about changes of the log, each with its place.
        notes: sentences about interruptions that the log itself explains.
    """

    files: int = 0
    records: int = 0
    first: Record | None = None
    last: Record | None = None
    head: LogHead = field(default_factory=lambda: LogHead(0, FIRST_HASH))
    faults: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def lines_of(folder: Path) -> Iterator[StoredLine]:
    """Yield the lines of the log in ``folder``, the oldest first.

    Raises InputError if there is no log or a file cannot be read.
    """
    try:
        paths = log_files(folder)
        if not paths:
            raise InputError(f"There is no event log in {folder}.")
        for path in paths:
            with path.open("rb") as file:
                number = 0
                while line := file.readline(MAX_READ_BYTES):
                    number += 1
                    content = line.removesuffix(b"\n")
                    yield StoredLine(path, number, content, line != content, decoded(content))
    except FileNotFoundError as error:
        raise InputError(f"There is no event log in {folder}.") from error
    except OSError as error:
        raise InputError(f"{error.filename or folder} cannot be read: {error.strerror}.") from error


def verified(folder: Path) -> LogReport:
    """Return the report on the log in ``folder``. Raises InputError if it cannot be read."""
    # Read first: a running server appends records meanwhile.
    head = _head(folder)
    check = _Verification(head)
    for line in lines_of(folder):
        check.line(line)
    return check.report()


def _head(folder: Path) -> LogHead | None:
    try:
        return LogHead.read((folder / HEAD_NAME).read_bytes())
    except OSError:
        return None


class _Verification:
    """Verification in progress. Each line is compared with the records before it."""

    def __init__(self, head: LogHead | None) -> None:
        self._head = head
        self._report = LogReport()
        self._places: OrderedDict[int, tuple[str, str]] = OrderedDict()
        self._newest = 0
        self._broken: list[StoredLine] = []
        self._path: Path | None = None
        self._previous = FIRST_HASH
        self._place = "the beginning"

    def line(self, line: StoredLine) -> None:
        """Verify the next line."""
        if line.path != self._path:
            self._report.files += 1
        if line.record is None or not line.ends:
            self._broken.append(line)
            return
        record, seq = line.record, int(line.record["seq"])
        self._account_for_broken(record)
        report, place = self._report, line.place
        if self._path is None:
            self._begin(line, seq)
        elif seq <= self._newest:
            self._fault(place, f"record {seq} is out of order, after record {self._newest}")
        elif seq > self._newest + 1:
            self._fault(place, f"{_records(self._newest + 1, seq - 1)} missing before it")
        if line.path != self._path and first_seq(line.path) != seq:
            self._fault(place, f"the first record of this file is {seq}")
        self._path = line.path
        before = self._places.get(seq - 1)
        if before is None and "missing" in _after(record):
            # After missing records the server continues with the hash of the line that is there.
            before = (self._previous, self._place)
        if before is not None and record["prev"] != before[0]:
            self._fault(
                before[1],
                f"the content does not match the hash in {place}: one of the two was changed",
            )
        self._explain(place, record)
        self._previous, self._place = hash_of(line.content), place
        self._places[seq] = (self._previous, place)
        while len(self._places) > KEPT_HASHES:
            self._places.popitem(last=False)
        if self._head is not None and seq == self._head.seq and self._previous != self._head.hash:
            self._fault(place, "the content does not match the hash in the file head")
        if seq > self._newest:
            self._newest, report.head = seq, LogHead(seq, self._previous)
            report.last = record
        report.first = report.first or record
        report.records += 1

    def report(self) -> LogReport:
        """Return the report after the last line."""
        report = self._report
        if self._broken:
            last = self._broken.pop()
            self._account_for_broken({})
            if last.ends:
                self._fault(last.place, "this is not a record: the line was changed or cut")
            else:
                # The head decides whether a whole record was here.
                report.notes.append(
                    f"{last.place}: the last line is incomplete. The server is writing it, or "
                    "was killed while writing."
                )
        if self._head is None:
            report.faults.append(
                f"The file {HEAD_NAME} is missing or invalid: whether records are missing at the "
                "end cannot be seen."
            )
        elif self._head.seq > self._newest:
            self._fault(
                self._place, f"{_records(self._newest + 1, self._head.seq)} missing after it"
            )
        return report

    def _begin(self, line: StoredLine, seq: int) -> None:
        """Verify the first record of the log."""
        oldest = seq if self._head is None else self._head.oldest
        if seq > oldest:
            self._fault(line.place, f"{_records(oldest, seq - 1)} missing before it")
        if seq == 1 and line.record is not None and line.record["prev"] != FIRST_HASH:
            self._fault(line.place, "the first record does not begin a chain: it was changed")

    def _account_for_broken(self, record: Record) -> None:
        """Verify that ``record`` describes the broken lines before it."""
        broken, self._broken = self._broken, []
        if not broken:
            return
        content = b"\n".join(each.content for each in broken)
        torn = _after(record).get("torn")
        if isinstance(torn, dict) and torn.get("sha256") == hash_of(content):
            self._report.notes.append(
                f"{broken[0].place}: an incomplete record of {len(content)} bytes. The server was "
                "killed while writing it, and stated this at its next start."
            )
            return
        for each in broken:
            self._fault(each.place, "this is not a record: the line was changed or cut")

    def _explain(self, place: str, record: Record) -> None:
        """Report what the server found when it opened the log."""
        after = _after(record)
        missing = after.get("missing")
        if isinstance(missing, dict):
            self._fault(
                place,
                f"record {missing.get('seq')} was the last one, and was gone when the server "
                "opened the log: it was cut, or lost with the power",
            )
        if "head" in after:
            self._fault(place, "the file head was gone when the server opened the log")

    def _fault(self, place: str, text: str) -> None:
        self._report.faults.append(f"{place}: {text}.")


def _after(record: Record) -> dict[str, Any]:
    """Return what ``record`` states about the log before it."""
    what = record.get("what")
    after = what.get("after") if isinstance(what, dict) else None
    return after if isinstance(after, dict) else {}


def _records(first: int, last: int) -> str:
    return f"record {first} is" if first == last else f"records {first} to {last} are"
