"""Joint angles to which tests of the gateway move the arm."""

from __future__ import annotations

import numpy as np

READY = np.deg2rad((0.0, -68.0, 85.0, 8.0, 0.0))
THERE = np.deg2rad((20.0, -60.0, 80.0, 20.0, -30.0))
FAR = np.deg2rad((120.0, -68.0, 85.0, 8.0, 0.0))
