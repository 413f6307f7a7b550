"""The page that viser makes of a recording, with our title and with steady light."""

from __future__ import annotations

import html

from katana450.errors import ConfigurationError

TITLE = "<title>Viser</title>"
"""Title of viser's page."""

CLEAR = "<style>canvas { opacity: 1 !important }</style>"
"""Draws at full opacity.

viser draws faintly until the light of the room is loaded. Where drawing takes as long as that it
loses count and leaves the picture faint for good; a recording loads the light again each time.
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
"""Keeps the light of the room when somebody seeks backwards and when the run begins anew.

viser's player puts back its own environment map before it plays the messages from the start. Ours
is then decoded again, and the scene is nearly black until that is done. The program of viser's
page is unpacked in the browser, so it is changed there, before it enters the page.
"""


def titled(page: str, title: str) -> str:
    """Return ``page``, as viser's serializer makes it, under ``title``.

    Raises ConfigurationError if viser's page is built otherwise.
    """
    if page.count(TITLE) != 1:
        raise ConfigurationError(f"viser's page has no {TITLE}: install the pinned version.")
    return page.replace(TITLE, f"<title>{html.escape(title)}</title>{CLEAR}{KEEP_LIGHT}")
