"""Write ``examples/programs/script.schema.json``: the JSON Schema of scripts, for editors.

Run it with ``python -m docs.script_schema``.
"""

from __future__ import annotations

import json
from pathlib import Path

from katana450.extensions.programs.script.script import script_schema

FILE = Path(__file__).resolve().parents[1] / "examples" / "programs" / "script.schema.json"


def content() -> str:
    """Return the content of the file."""
    return json.dumps(script_schema(), indent=1) + "\n"


def main() -> None:
    """Write the file."""
    FILE.write_text(content(), encoding="utf-8")


if __name__ == "__main__":
    main()
