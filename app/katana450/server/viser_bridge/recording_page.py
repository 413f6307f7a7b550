"""The page that viser makes for a recording, changed to have our title and constant light."""

from __future__ import annotations

import html

from katana450.errors import ConfigurationError

TITLE = "<title>Viser</title>"
"""The title element of viser's page."""

CLEAR = "<style>canvas { opacity: 1 !important }</style>"
"""Style that draws at full opacity.

viser draws faintly until the light of the room is loaded. If drawing takes as long as that, viser
miscounts and the picture stays faint. A recording loads the light again each time.
"""

KEEP_LIGHT = """<script>{
  const append = document.head.appendChild;
  document.head.appendChild = function (node) {
    if (node.type === 'module') {
      delete document.head.appendChild;
      const reset = /[\\w$]+\\.useEnvironment\\.set\\([\\w$]+\\(\\)\\)/;
      node.textContent = node.textContent.replace(reset, 'void 0');
    }
    return append.call(this, node);
  };
}</script>"""
"""Script that keeps the light of the room when the recording is played from the start again.

viser's player sets its own environment map before it plays the messages from the start, also to
seek backwards. Our map is then decoded again, and the scene is nearly black until that is done.
viser's program is unpacked in the browser, so the script changes it there, before it runs.
"""


def titled(page: str, title: str) -> str:
    """Return the ``page`` of viser's serializer with ``title`` and constant light.

    Raises ConfigurationError if viser's page has another structure.
    """
    if page.count(TITLE) != 1:
        raise ConfigurationError(
            f"viser's page must contain {TITLE} once: install the pinned version of viser."
        )
    return page.replace(TITLE, f"<title>{html.escape(title)}</title>{CLEAR}{KEEP_LIGHT}")
