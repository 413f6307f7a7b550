"""A minimal viser app with a gizmo, with which drag_to_frame.py compares the app.

The gizmo is built as in the app, from three controls: arrows, a pitch ring and a roll ring. Each
callback only moves one node and flushes.
"""

from __future__ import annotations

import argparse
import contextlib
import math
import signal
import threading

import viser
import viser.transforms as vtf

START = (0.25, 0.0, 0.25)
GIZMO_SCALE = 0.2


def add_gizmo(server: viser.ViserServer) -> None:
    """Show a box at the gizmo and keep it there while any of the three controls is dragged."""
    scene = server.scene
    # Flat, so that a turn of the box is visible, and small enough to hide no handle.
    box = scene.add_box("/arm/box", color=(225, 140, 40), dimensions=(0.05, 0.03, 0.015))
    move = scene.add_transform_controls("/target/move", GIZMO_SCALE, disable_rotations=True)
    # A ring is drawn if both axes of its plane are active: z and x give the ring about y.
    pitch = scene.add_transform_controls(
        "/target/move/pitch",
        GIZMO_SCALE,
        active_axes=(True, False, True),
        disable_axes=True,
        disable_sliders=True,
    )
    roll = scene.add_transform_controls(
        "/target/move/roll",
        GIZMO_SCALE,
        active_axes=(False, True, True),
        disable_axes=True,
        disable_sliders=True,
    )

    async def translate(_: object) -> None:
        box.position = move.position
        server.flush()

    async def rotate(_: object) -> None:
        box.wxyz = (vtf.SO3(pitch.wxyz) @ vtf.SO3(roll.wxyz)).wxyz
        server.flush()

    move.on_update(translate)
    pitch.on_update(rotate)
    roll.on_update(rotate)

    async def reset(_: object) -> None:
        with server.atomic():
            move.position = box.position = START
            pitch.wxyz = roll.wxyz = box.wxyz = (1.0, 0.0, 0.0, 0.0)
        server.flush()

    move.position = box.position = START
    server.gui.add_button("Reset").on_click(reset)


def add_slider(server: viser.ViserServer) -> None:
    """Turn a second node about z by a slider in degrees."""
    dial = server.scene.add_frame("/arm/dial", axes_length=0.1, axes_radius=0.003)
    slider = server.gui.add_slider("Axis 1", min=-170.0, max=170.0, step=0.1, initial_value=0.0)

    async def turn(_: object) -> None:
        dial.wxyz = vtf.SO3.from_z_radians(math.radians(slider.value)).wxyz
        server.flush()

    slider.on_update(turn)


def main() -> None:
    """Serve until interrupted, on the given port only."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port", type=int, required=True)
    port = parser.parse_args().port
    server = viser.ViserServer(host="127.0.0.1", port=port, verbose=False)
    if server.get_port() != port:
        server.stop()
        raise SystemExit(f"port {port} is taken: stop what uses it or choose another --port")
    add_gizmo(server)
    add_slider(server)
    print(f"bare viser app is ready: http://127.0.0.1:{port}", flush=True)
    # Processes in the background of a shell start with Ctrl-C ignored.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    with contextlib.suppress(KeyboardInterrupt):
        threading.Event().wait()
    server.stop()


if __name__ == "__main__":
    main()
