"""The script that records what static/viser.js sees in a page of viser."""

from __future__ import annotations

from katana450.assembly.page_routes import put_together
from katana450.server.web.static_files import contents

TAPPED = """
import * as Address from "./viser/address.js";
import * as Names from "./viser/names.js";
import * as Pictures from "./viser/pictures.js";
import * as Structure from "./viser.js";
    const Viser = { ...Address, ...Names, ...Pictures, ...Structure };
    Viser.forgoCode();
    const style = new CSSStyleSheet();
    style.replaceSync(Viser.STEADY);
    document.adoptedStyleSheets.push(style);
    window.tapped = { sends: [], views: [], choices: [], sets: [], connected: 0, replayed: 0,
                      panels: 0, painted: new Map(), controls: new Map(), withheld: null };
    Viser.interceptMessages({
        server(address, line) {
            Object.assign(tapped, { address, line });
            return address;
        },
        sends(message) {
            tapped.sends.push(message.type);
            if (Viser.viewOf(message)) tapped.views.push(Viser.viewOf(message));
            if (Viser.choiceOf(message)) tapped.choices.push(Viser.choiceOf(message));
            return message.type !== tapped.withheld;
        },
        connected: () => (tapped.connected += 1),
        receives(messages) {
            Viser.keepControls(tapped.controls, messages);
            tapped.replayed += Viser.replayed(messages);
            tapped.panels += Viser.controlsIn(messages);
            const [position, target] = Viser.viewsIn(messages);
            if (position && target) tapped.sets.push([position, target]);
            for (const each of Viser.paint(structuredClone(messages), { sky: "", dark: false }))
                tapped.painted.set(each.type, messages.find(({ type }) => type === each.type));
        },
    });
    window.Viser = Viser;
"""


def script(more: str = "") -> str:
    """Return what records the messages of static/viser.js, and ``more`` after it."""
    entry = {"recorded.js": f"{TAPPED}\n{more}".encode()}
    return put_together("recorded.js", contents() | entry).decode()
