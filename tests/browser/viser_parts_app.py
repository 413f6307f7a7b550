"""A viser app with one object of each kind that our scripts use in viser's page."""

from __future__ import annotations

import argparse
import contextlib
import io
import signal
import threading

import numpy as np
import viser

EYE, TARGET = (1.0, -1.0, 1.0), (0.0, 0.0, 0.2)


def furnish(server: viser.ViserServer) -> None:
    """Fill scene and panel."""
    scene, gui = server.scene, server.gui
    scene.set_up_direction("+z")
    scene.add_grid("/floor")
    scene.set_background_image(np.full((4, 4, 3), 200, np.uint8))
    box = scene.add_box("/box", color=(225, 140, 40), dimensions=(0.1, 0.1, 0.1))
    # A handle in front of a box of its own.
    scene.add_box("/held", color=(40, 140, 225), dimensions=(0.1, 0.1, 0.1), position=(0, 0.4, 0))
    scene.add_transform_controls("/handle", position=(0.0, 0.4, 0.0), scale=0.3)
    scene.add_transform_controls("/hidden", position=(0.0, -0.4, 0.0), scale=0.3, visible=False)
    scene.add_label("/label", "A label", position=(0.0, 0.0, 0.5))
    gui.configure_theme(dark_mode=False)
    gui.main_panel.dock_right()
    server.initial_camera.position = EYE
    server.initial_camera.look_at = TARGET
    slider = gui.add_slider("Height", min=-1.0, max=2.0, step=0.1, initial_value=0.0)
    gui.add_vector3("Point", (1.0, 2.0, 3.0), min=(-5.0, -6.0, -7.0), max=(5.0, 6.0, 7.0), step=0.5)
    view = gui.add_button_group("View", ("Front", "Side"), hint="Where to look from")

    async def lift(_: object) -> None:
        box.position = (0.0, 0.0, slider.value)

    async def look(event: viser.GuiEvent[viser.GuiButtonGroupHandle]) -> None:
        assert event.client is not None
        eye = (2.0, 0.0, 0.5) if view.value == "Front" else (0.0, -2.0, 0.5)
        event.client.camera.position, event.client.camera.look_at = eye, TARGET

    slider.on_update(lift)
    view.on_click(look)


def main() -> None:
    """Serve on the given port until interrupted."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port", type=int, required=True)
    port = parser.parse_args().port
    with contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host="127.0.0.1", port=port, verbose=False)
    if server.get_port() != port:
        raise SystemExit(f"port {port} is taken")
    furnish(server)
    print(f"viser parts app is ready: http://127.0.0.1:{port}", flush=True)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    with contextlib.suppress(KeyboardInterrupt):
        threading.Event().wait()
    server.stop()


if __name__ == "__main__":
    main()
