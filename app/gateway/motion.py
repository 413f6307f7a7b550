"""The arm as the gateway sees it: what it asks of it, and what it can tell of it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from app.api.requests import Rates
from app.collision.world import World
from app.control import commands as cmd
from app.control.choices import Choice
from app.control.ledger import Entry
from app.control.margins import Margins, margins
from app.control.pouring import Pouring
from app.control.session import Session
from app.control.state import State
from app.control.things import Surroundings
from app.errors import InputError
from app.geometry.arrays import FloatArray
from app.kinematics.statics import holding_torques
from app.kinematics.velocity import JogFrame
from app.programs.bench import Rig
from app.robot.model import RobotModel
from app.robot.weight import loads_of
from app.runtime.board import Snapshot
from app.runtime.lateness import Lateness
from app.runtime.link import FrontEnd
from app.runtime.navigator import Navigator


class Motion:
    """One arm."""

    def __init__(
        self,
        model: RobotModel,
        session: Session,
        link: FrontEnd,
        navigator: Navigator,
        let_go: Callable[[], None],
    ) -> None:
        """``let_go`` takes the handles of the view out of every hand."""
        self.model = model
        self._session = session
        self._link = link
        self._board = link.board
        self._navigator = navigator
        self._let_go = let_go
        self._loads = loads_of(model)
        self._measured: (
            tuple[tuple[str, World | None, bytes], tuple[Margins, FloatArray | None]] | None
        ) = None

    @property
    def snapshot(self) -> Snapshot:
        """The newest."""
        return self._board.snapshot

    @property
    def ready(self) -> FloatArray:
        """(n,) the posture that Home drives to [rad]."""
        return self._session.ready

    @property
    def surroundings(self) -> Surroundings:
        """Knows where things are."""
        return self._session.surroundings

    @property
    def pouring(self) -> Pouring | None:
        """Knows where water is."""
        return self._session.pouring

    @property
    def rig(self) -> Rig:
        """What programs are planned for."""
        return Rig(self._session, self.model.T_base_shoulder)

    @property
    def lateness(self) -> Lateness:
        """How well the control loop keeps its period."""
        return self._board.lateness

    @property
    def holding(self) -> FloatArray | None:
        """(n,) torques that hold it still [N m]; None where nobody knows what it weighs."""
        return self._posture()[1]

    @property
    def margins(self) -> Margins:
        """How near it is to what it cannot pass."""
        return self._posture()[0]

    def _posture(self) -> tuple[Margins, FloatArray | None]:
        """Worked out once for everybody who asks, and anew when something has changed."""
        state = self.state
        world, x = self._session.world_at(state), np.append(state.q, state.gripper)
        key = (state.tool, world, x.tobytes())
        if self._measured is None or self._measured[0] != key:
            chain = self.model.arm.chain_to(state.tool)
            holding = holding_torques(chain, state.q, self._loads) if self._loads else None
            self._measured = (key, (margins(chain, world, x), holding))
        return self._measured[1]

    def choices(self) -> tuple[Choice, ...]:
        """The branches there are to choose from."""
        return self._session.choices(self.state)

    def put(self, command: cmd.Command) -> int:
        """Any command; its ticket. Raises InputError for one that cannot be."""
        return self._navigator.put(command)

    @property
    def state(self) -> State:
        """The newest."""
        return self._board.snapshot.state

    @property
    def ledger(self) -> tuple[Entry, ...]:
        """What held it back of late, oldest first."""
        return self._board.ledger

    @property
    def caught_up(self) -> bool:
        """Whether the newest state has every command in it."""
        return self.snapshot.ticket == self._link.last_ticket

    @property
    def busy(self) -> bool:
        """Whether a way is being worked out that the arm will then go."""
        return self._navigator.busy

    def beat(self) -> None:
        """Tell the arm that somebody watches over it."""
        self._link.beat()

    def stop(self) -> None:
        """Rest as fast as the arm can; it obeys nothing until it is released."""
        self._navigator.put(cmd.Stop())
        self._let_go()

    def release(self) -> None:
        """After a stop: obey again. Nothing moves by this."""
        self._navigator.put(cmd.Release())

    def hold(self) -> None:
        """Come to rest and forget every target; no hand holds a handle any more."""
        self._let_go()
        self._put(cmd.Reset())

    def jog(self, rates: Rates, frame: JogFrame) -> None:
        """Go with these rates for a moment."""
        self._put(cmd.Jog(np.array(rates), frame))

    def limit(self, share: float) -> None:
        """No motion is faster than this share of the most."""
        self._put(cmd.SpeedScale(share))

    def _put(self, command: cmd.Command) -> None:
        try:
            self._navigator.put(command)
        except InputError:
            # The mailbox is full: what is asked again and again is, and a stop always has room.
            return
