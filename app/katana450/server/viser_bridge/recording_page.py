"""The page that viser makes for a recording, changed to say what it shows and to play on."""

from __future__ import annotations

import html
import json

from katana450.errors import ConfigurationError

TITLE = "<title>Viser</title>"
"""The title element of viser's page."""

CLEAR = "<style>canvas { opacity: 1 !important }</style>"
"""Style that draws at full opacity.

viser draws faintly until the light of the room is loaded. If drawing takes as long as that, viser
miscounts and the picture stays faint. A recording loads the light again each time.
"""

PLAYER = """<script>{
  const append = document.head.appendChild;
  const replaced = [
    [/[\\w$]+\\.useEnvironment\\.set\\([\\w$]+\\(\\)\\)/, 'void 0'],
    [/(\\.currentTime=([\\w$]+),[\\w$]+\\(\\2\\)),[\\w$]+\\(!0\\)/, '$1'],
    [/(size:`md`,variant:`subtle`,)(onClick:\\(\\)=>[\\w$]+\\(!([\\w$]+)\\))/,
     '$1"aria-label":$3?`Play`:`Pause`,$2'],
  ];
  document.head.appendChild = function (node) {
    if (node.type === 'module') {
      delete document.head.appendChild;
      for (const [part, by] of replaced) node.textContent = node.textContent.replace(part, by);
    }
    return append.call(this, node);
  };
}</script>"""
"""Script that changes viser's player before it runs; its program is unpacked in the browser.

1. The player sets its own environment map before it plays the messages from the start, also to seek
   backwards. Our map is then decoded again, and the scene is nearly black until that is done.
2. Seeking pauses it without a word. Now it plays on from there.
3. The button that plays and pauses has no name for screen readers.
"""

NARROW = """<script>{
  const FITS = 1.2;
  const timer = setInterval(() => {
    const { camera, cameraControl, canvas, nodeRefFromName } = window.__viserMutable ?? {};
    if (!cameraControl || !canvas.clientHeight || !nodeRefFromName['/arm']) return;
    clearInterval(timer);
    const aspect = canvas.clientWidth / canvas.clientHeight;
    if (aspect < FITS) cameraControl.dollyTo((cameraControl.distance * FITS) / aspect, false);
  }, 50);
}</script>"""
"""Script that looks from farther away in a picture that is narrower than FITS times its height.

The field of view is a vertical angle, so such a picture would cut the robot off at its sides.
"""

CAPTION = """<style>#caption {{ position: fixed; left: 1em; bottom: 4em; z-index: 2; margin: 0;
  padding: 0.3em 0.7em; border-radius: 0.4em; font: 14px system-ui, sans-serif; color: #1e293b;
  background: rgb(255 255 255 / 80%); pointer-events: none }}</style>
<script>addEventListener('DOMContentLoaded', () => {{
  const caption = document.createElement('p');
  caption.id = 'caption';
  caption.textContent = {text};
  document.body.append(caption);
}})</script>"""
"""Element that says what is shown."""


def titled(page: str, title: str, caption: str) -> str:
    """Return the ``page`` of viser's serializer with ``title``, ``caption`` and constant light.

    Raises ConfigurationError if viser's page has another structure.
    """
    if page.count(TITLE) != 1:
        raise ConfigurationError(
            f"viser's page must contain {TITLE} once: install the pinned version of viser."
        )
    shown = CAPTION.format(text=json.dumps(caption).replace("<", "\\u003c"))
    return page.replace(TITLE, f"<title>{html.escape(title)}</title>{CLEAR}{PLAYER}{NARROW}{shown}")
