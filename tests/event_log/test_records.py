"""Test how notes become records: streams, secrets, and floods."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.commands.act import Command
from katana450.arm.control.lease import Actor, CommandChannel, Grounds, Person, Role
from katana450.arm.control.session.session import Session
from katana450.assembly.event_log.disk_log import MAX_LINE_BYTES, encoded
from katana450.assembly.event_log.record_maker import (
    BURST,
    MAX_TEXT,
    RATE,
    STREAM_GAP,
    Record,
    RecordMaker,
    content_of,
    record,
)
from katana450.server.api import requests
from katana450.server.service.hub import Hub
from katana450.server.service.identity import Identity
from katana450.server.service.recorder import MAX_WAITING, Note, Recorder
from tests.control.test_commands import examples

ANNA = Actor(
    Person("secret/page", "Anna", Role.OPERATOR, address="10.0.0.7"),
    CommandChannel.PAGE,
    grounds=Grounds.LEASE,
)
BERT = replace(ANNA, person=Person("other/page", "Bert", Role.VIEWER, address="10.0.0.8"))


def command(t: float, value: Command, actor: Actor = ANNA) -> Note:
    return Note(t, "command", actor, value, "accepted")


def made(*notes: Note, end: float = 1000.0) -> list[Record]:
    return RecordMaker().made(list(notes), end, closing=True)


def what(log: list[Record]) -> list[tuple[str, str]]:
    return [(row["kind"], row["what"]["command"]) for row in log]


def test_stream_makes_a_record_of_its_first_command() -> None:
    notes = [command(n / 50, cmd.Servo(np.full(5, n / 10))) for n in range(100)]
    (first,) = made(*notes)
    assert first["what"]["q"] == [0.0] * 5
    assert (first["t"], first["grounds"]) == (0.0, "holds the lease")


def test_pause_another_joint_and_another_participant_begin_new_streams() -> None:
    later = 0.1 + STREAM_GAP * 1.01
    log = made(
        command(0.0, cmd.Joint(1, 0.1)),
        command(0.1, cmd.Joint(1, 0.2)),
        command(0.1, cmd.Joint(2, 0.2)),
        command(later, cmd.Joint(1, 0.3)),
        command(later, cmd.Joint(1, 0.4), actor=BERT),
    )
    assert what(log) == 4 * [("command", "Joint")]
    assert [row["what"].get("axis") for row in log] == [1, 2, 1, 1]


JOG, RELEASE = cmd.Jog(np.array([0.1, 0, 0, 0, 0])), cmd.Jog(np.zeros(5))

STOP = Note(0.25, "stop", BERT, {"stop": "pressed"}, always=True)

STREAMS: dict[str, tuple[list[Note], list[float]]] = {
    "a stop ends a stream": (
        [*(command(n / 10, JOG) for n in range(3)), STOP, command(0.3, JOG), command(0.4, JOG)],
        [0.0, 0.25, 0.3],
    ),
    "a released key ends the stream of jogs": (
        [command(n / 10, jog) for n, jog in enumerate((JOG, RELEASE, JOG, RELEASE))],
        [0.0, 0.2],
    ),
    "a long stream makes records on the way": (
        [command(n / 2, cmd.Servo(np.zeros(5))) for n in range(300)],
        [0.0, 60.5, 121.0],
    ),
    "nudges are recorded one by one": (
        [command(n / 10, cmd.Nudge(3, 0.1)) for n in range(3)],
        [0.0, 0.1, 0.2],
    ),
    "a drag of the ring at the elbow is recorded once": (
        [command(n / 20, cmd.TurnElbow(0.01)) for n in range(5)],
        [0.0],
    ),
}


def test_streams_begin_and_end() -> None:
    times = {name: [row["t"] for row in made(*notes)] for name, (notes, _) in STREAMS.items()}
    assert times == {name: expected for name, (_, expected) in STREAMS.items()}


def test_streams_that_have_ended_are_forgotten() -> None:
    maker = RecordMaker()
    maker.made([command(0.0, cmd.Joint(1, 0.1))], 0.0)
    maker.made([], 1.01 * STREAM_GAP)
    assert maker._streams == {}


def test_participant_is_described_without_its_key() -> None:
    (record,) = made(command(1.0, cmd.Home()))
    assert record["who"] == {
        "name": "Anna",
        "role": "operator",
        "channel": "page",
        "address": "10.0.0.7",
    }
    assert "secret" not in str(record)


def test_values_are_bounded_and_without_secrets() -> None:
    hello = content_of(requests.Hello(name="x" * 40, token="secret"))
    assert "secret" not in str(hello)
    assert content_of(cmd.Tool("x\n" * 500_000))["name"].startswith("x\n" * (MAX_TEXT // 2))
    batch = cmd.Batch(tuple(cmd.Tool("x" * 1000) for _ in range(1000)))
    person = replace(ANNA.person, name="A\n\u2028\x1b[31m\ud800" * 200_000)
    (record,) = made(Note(1.0, "refusal", replace(ANNA, person=person), batch, why="y" * 1_000_000))
    assert record["what"]["count"] == 1000
    assert len(encoded(record)) <= MAX_LINE_BYTES
    assert content_of(cmd.Pose(np.eye(4)))["T"] == np.eye(4).ravel().tolist()


def test_every_command_has_a_short_record(session: Session) -> None:
    for act in examples(session, session.begin(session.ready, 0.0, 0.0)):
        line = encoded(record("command", content_of(act)))
        assert len(line) < MAX_LINE_BYTES / 4, line
        assert "omitted" not in line


def test_flood_of_one_participant_is_counted_and_leaves_room_for_others() -> None:
    flood = [Note(n / 1000, "refusal", BERT, {"request": "Home"}) for n in range(20_000)]
    drive = [command(n / 2, cmd.Nudge(1, 0.1)) for n in range(40)]
    maker = RecordMaker()
    log: list[Record] = []
    for note in sorted((*flood, *drive), key=lambda note: note.t):
        log += maker.made([note], note.t)
    log += maker.made([], 1000.0, closing=True)
    kinds = [row["kind"] for row in log]
    assert kinds.count("command") == 40
    assert kinds.count("refusal") <= BURST + 20.0 * RATE + 1
    more = [row for row in log if row["kind"] == "more"]
    assert len(more) <= 3
    assert sum(row["what"]["count"] for row in more) + kinds.count("refusal") == 20_000


def test_flood_of_many_strangers_is_counted() -> None:
    people = [
        replace(BERT, person=Person("", "Somebody", Role.VIEWER, address=f"10.0.{n % 250}.{n}"))
        for n in range(5000)
    ]
    log = made(*(Note(1.0, "sign-in", person, outcome="refused") for person in people))
    written = sum(row["kind"] == "sign-in" for row in log)
    counted = sum(row["what"]["count"] for row in log if row["kind"] == "more")
    assert written <= 4 * BURST
    assert written + counted == 5000
    assert len(log) < 1000


def test_first_stop_is_recorded_whatever_came_before() -> None:
    flood = [Note(1.0, "stop", BERT, {"stop": "pressed", "repeated": True}) for _ in range(1000)]
    log = made(*flood, Note(1.0, "stop", BERT, {"stop": "pressed"}, always=True))
    assert log[-2]["what"] == {"stop": "pressed"}
    assert log[-1]["kind"] == "more"


def test_only_a_clear_that_follows_a_stop_is_recorded_whatever_came_before() -> None:
    flood = [command(1.0, cmd.ClearStop()) for _ in range(1000)]
    stop = Note(1.0, "stop", BERT, {"stop": "pressed"}, always=True)
    log = made(*flood, stop, *flood[:2])
    assert [row["kind"] for row in log[-3:]] == ["stop", "clear", "more"]
    assert sum(row["kind"] == "clear" for row in log) == BURST + 1


def test_notes_that_nobody_reads_do_not_pile_up() -> None:
    recorder = Recorder()
    recorder.command(cmd.Home(), ANNA)
    assert recorder.notes.empty()
    recorder.enabled = True
    for _ in range(MAX_WAITING + 10):
        recorder.command(cmd.Home(), ANNA)
    assert (recorder.notes.qsize(), recorder.lost) == (MAX_WAITING, 10)
    # Among them no repeated stop, but the first one.
    recorder.stop("Bert pressed STOP.", BERT, first=False)
    recorder.stop("Anna pressed STOP.", ANNA, first=True)
    assert (recorder.notes.qsize(), recorder.lost) == (MAX_WAITING + 1, 11)


@pytest.mark.parametrize("closed", [False, True])
def test_lease_of_a_driver_who_left_is_recorded_as_free(closed: bool) -> None:
    hub = Hub(lambda: 1.0)
    people = [Identity(name, name, Role.ADMIN) for name in ("Bert", "Anna")]
    bert, anna = (hub.join(person, "page", lambda _: None) for person in people)
    hub.gate.acquire(bert.actor)
    if closed:
        hub.close(people[0], "page")
    hub.recorder.enabled = True
    hub.take(anna)
    (record,) = made(hub.recorder.notes.get_nowait() or Note(0.0, ""))
    assert (record["what"]["lease"], record["grounds"]) == (
        ("acquired", "the lease was free") if closed else ("taken", "an admin may take the lease")
    )
    assert (record["what"]["from"], record["what"]["to"]) == ("Bert", "Anna")
