"""The figure of a plan: the tool's path in space, and the joints over time."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np

from katana450.extensions.media.figures import AXES, STYLE, TIME, draw_joints, equal_axes
from katana450.library.trajectory import Trajectory


def figure_of(samples: Trajectory) -> Any:
    """Draw ``samples`` of a plan and return the matplotlib ``Figure``, still open."""
    plt = importlib.import_module("matplotlib.pyplot")
    points = 1e3 * samples.points
    with plt.rc_context(STYLE):
        figure = plt.figure(figsize=(9.0, 3.9), layout="constrained")
        space = figure.add_subplot(1, 2, 1, projection="3d")
        space.plot(*points.T, color=AXES[0], linewidth=1.4)
        space.scatter(*points[0], color=AXES[1], s=16, label="start")
        equal_axes(space, points)
        space.set_title("Path of the tool point")
        space.set(xlabel="x (mm)", ylabel="y (mm)", zlabel="z (mm)")
        space.legend(loc="upper left", fontsize=8.0)
        panel = figure.add_subplot(1, 2, 2)
        draw_joints(panel, samples.t, np.degrees(samples.q))
        panel.set_title("Joint angles")
        panel.set_xlabel(TIME)
        panel.set_ylabel("angle (deg)")
        panel.legend(ncols=samples.q.shape[1], fontsize=8.0, loc="upper center")
        panel.margins(x=0.0, y=0.15)
    return figure
