"""``python -m app`` is ``katana450``."""

import sys

from app.cli import main

sys.exit(main())
