"""Entry point of ``python -m katana450``, which does the same as the command ``katana450``."""

import sys

from katana450.cli import main

sys.exit(main())
