"""The connectors on the control box's panel, which faces -y: terminals, sockets, a switch; mm."""

from __future__ import annotations

from robot_description.cad.material import BRIGHT, GREEN, PANEL, PLASTIC, STEEL
from robot_description.cad.outline import rounded
from robot_description.cad.part import Part
from robot_description.cad.solid import Range, block, lathe, prism, rod

STRIP_X, STRIP_Z, STRIP_DEPTH, TERMINALS = (-46.0, 38.0), (55.0, 62.5), 6.0, 10
NETWORK_X, NETWORK_Z = (-44.0, -24.0), (21.5, 37.0)
NETWORK_WIDTH = 16.0
SERIAL_X, SERIAL_Z = (-3.0, 7.0), (22.5, 33.0)
USB_X, USB_Z = (12.5, 27.0), ((22.0, 29.0), (32.5, 39.5))
POWER_X, POWER_Z = (36.0, 50.0), (21.5, 32.0)
SWITCH = (44.0, 46.0)
SOCKET_STANDS, WALL = 1.8, 1.2
LABEL_Z, LABEL_HEIGHT = 18.3, 1.2


def _socket(part: Part, x: Range, z: Range, front: float) -> None:
    """Add a metal shell with a dark mouth."""
    part.add(BRIGHT, block(x, (front - SOCKET_STANDS, front + 1.0), z, 0.5))
    mouth_x, mouth_z = (x[0] + WALL, x[1] - WALL), (z[0] + WALL, z[1] - WALL)
    part.cut(block(mouth_x, (front - 9.0, front - 0.2), mouth_z), of=BRIGHT)
    part.add(PLASTIC, block(mouth_x, (front - 0.5, front + 0.8), mouth_z))


def _network(part: Part, low: float, front: float) -> None:
    """Add a network socket: a mouth with the latch's notch below, two lamps above."""
    high, (bottom, top) = low + NETWORK_WIDTH, NETWORK_Z
    middle = (low + high) / 2
    part.add(BRIGHT, block((low, high), (front - SOCKET_STANDS, front + 1.0), NETWORK_Z, 0.5))
    mouth = prism(
        rounded(
            [
                (middle - 3.0, bottom + 1.4, 0.0),
                (middle + 3.0, bottom + 1.4, 0.0),
                (middle + 3.0, bottom + 4.0, 0.0),
                (high - 2.0, bottom + 4.0, 0.0),
                (high - 2.0, top - 3.4, 0.0),
                (low + 2.0, top - 3.4, 0.0),
                (low + 2.0, bottom + 4.0, 0.0),
                (middle - 3.0, bottom + 4.0, 0.0),
            ]
        ),
        front - 9.0,
        front - 0.2,
        0.0,
        "y",
    )
    part.cut(mouth, of=BRIGHT)
    part.add(
        PLASTIC, block((low + 1.8, high - 1.8), (front - 0.5, front), (bottom + 1.2, top - 3.0))
    )
    for lamp in (low + 3.2, high - 3.2):
        stands = front - SOCKET_STANDS
        part.add(
            GREEN, block((lamp - 1.2, lamp + 1.2), (stands - 0.3, front), (top - 2.3, top - 1.0))
        )


def _terminals(part: Part, front: float) -> None:
    """Add the row of screw terminals, each with a hole for the wire and the head of a screw."""
    shell = block(STRIP_X, (front - STRIP_DEPTH, front + 1.0), STRIP_Z, 0.5)
    pitch = (STRIP_X[1] - STRIP_X[0]) / TERMINALS
    middle = sum(STRIP_Z) / 2
    part.add(GREEN, shell)
    for k in range(TERMINALS):
        x = STRIP_X[0] + (k + 0.5) * pitch
        slot = block((x - 2.8, x + 2.8), (front - 9.0, front - 3.0), (STRIP_Z[0] + 1.2, 70.0))
        part.cut(slot, of=GREEN)
        head = rod(4.2, 0.0, 4.2, "-y", (x, front, middle), segments=10)
        part.add(STEEL, head)


def connectors(part: Part, front: float) -> None:
    """Add all connectors to the panel whose face is at y ``front``."""
    _terminals(part, front)
    for low in NETWORK_X:
        _network(part, low - NETWORK_WIDTH / 2 + 1.0, front)
    _socket(part, SERIAL_X, SERIAL_Z, front)
    for z in USB_Z:
        _socket(part, USB_X, z, front)
        tongue = ((USB_X[0] + 3.0, USB_X[1] - 3.0), (z[0] + 3.6, z[1] - 1.8))
        part.add(PANEL, block(tongue[0], (front - 1.2, front), tongue[1]))
    part.add(GREEN, block(POWER_X, (front - 4.5, front + 1.0), POWER_Z, 0.6))
    middle = sum(POWER_Z) / 2
    for x in (POWER_X[0] + 4.0, POWER_X[1] - 4.0):
        part.cut(block((x - 2.2, x + 2.2), (front - 9.0, front - 2.0), POWER_Z), of=GREEN)
        head = rod(3.6, 0.0, 3.2, "-y", (x, front, middle), segments=10)
        part.add(STEEL, head)
    x, height = SWITCH
    ring = [(-1.0, 7.0, 0.0), (1.8, 7.0, 0.6), (1.8, 5.0, 0.0), (0.2, 5.0, 0.0)]
    part.add(BRIGHT, lathe(ring, "-y", (x, front, height), segments=24))
    part.add(
        PLASTIC, lathe([(-0.5, 4.4, 0.0), (2.8, 4.4, 0.6)], "-y", (x, front, height), segments=20)
    )
    labels = [
        *(low + 1.0 for low in NETWORK_X),
        sum(SERIAL_X) / 2,
        sum(USB_X) / 2,
        sum(POWER_X) / 2,
    ]
    for x in labels:
        label = ((x - 3.5, x + 3.5), (LABEL_Z - LABEL_HEIGHT / 2, LABEL_Z + LABEL_HEIGHT / 2))
        part.add(PLASTIC, block(label[0], (front - 0.15, front + 0.5), label[1]))
