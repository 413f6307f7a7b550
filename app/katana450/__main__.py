"""``python -m katana450`` is ``katana450``."""

import sys

from katana450.cli import main

sys.exit(main())
