"""Figure of a measured arm beside its setpoints. matplotlib is imported only when it is drawn."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from katana450.extensions.media.figures import (
    AXES,
    DESIRED,
    ERROR,
    INK,
    STYLE,
    TIME,
    equal_axes,
    pyplot,
    to_png,
)
from katana450.extensions.programs.measured_run import Deviation, MeasuredRun
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.planning.path import point_derivatives

DRAWN = 0.15
"""[1] Maximum distance of the drawn path of the tool from the desired one, by the size of that."""

GAP = 0.3
"""[s] Time between two measurements above which a line is broken."""

RIGHT: dict[str, Any] = {"ha": "right", "va": "top"}
"""Alignment of a text in the upper right corner."""

SAMPLES = 400
"""Number of intervals of a drawn path."""


def measured_figure(run: MeasuredRun) -> bytes:
    """Return a PNG of path, distances from it and errors of the joints; of these without paths."""
    plt = pyplot()
    deviations = run.deviations
    with plt.rc_context(STYLE):
        figure = plt.figure(figsize=(7.2, 5.2 if deviations else 3.0))
        if deviations:
            space = figure.add_axes((-0.02, 0.06, 0.53, 0.9), projection="3d")
            _draw_paths(plt, space, deviations)
            figure.text(0.02, 0.935, "Path of the tool", fontsize=10.0, fontweight="bold")
            upper = figure.add_axes((0.6, 0.57, 0.38, 0.35))
            _draw_distances(upper, deviations)
            lower = figure.add_axes((0.6, 0.1, 0.38, 0.34), sharex=upper)
        else:
            lower = figure.add_axes((0.1, 0.16, 0.88, 0.72))
        _draw_joint_errors(lower, run)
        return to_png(plt, figure)


def magnification(deviations: tuple[Deviation, ...]) -> float:
    """Return the round number, at least 1, by which distances from paths are best drawn."""
    points = np.concatenate([each.nearest for each in deviations])
    size = float((points.max(axis=0) - points.min(axis=0)).max())
    worst = max(float(each.error.max()) for each in deviations)
    if worst <= 0.0 or size <= 0.0:
        return 1.0
    most = max(DRAWN * size / worst, 1.0)
    power = 10.0 ** math.floor(math.log10(most))
    return power * max(each for each in (1.0, 2.0, 5.0) if power * each <= most)


def _draw_paths(plt: Any, space: Any, deviations: tuple[Deviation, ...]) -> None:
    times = magnification(deviations)
    by = f", distances × {times:g}" if times > 1.0 else ""
    drawn: list[FloatArray] = []
    for number, each in enumerate(deviations):
        desired = 1e3 * point_derivatives(each.path, np.linspace(0.0, 1.0, SAMPLES + 1))[0]
        seen = 1e3 * (each.nearest + times * (each.measured - each.nearest))
        names = ("desired", f"measured{by}") if number == 0 else (None, None)
        space.plot(*desired.T, color=DESIRED, linewidth=3.0, alpha=0.7, label=names[0])
        space.plot(*seen.T, color=ERROR, linewidth=1.1, label=names[1])
        space.scatter(*desired[0], color=INK, s=12)
        drawn += [desired, seen]
    equal_axes(space, np.concatenate(drawn))
    space.set_xlabel("x (mm)")
    space.set_ylabel("y (mm)")
    space.set_zlabel("z (mm)", labelpad=9.0)
    for axis in (space.xaxis, space.yaxis, space.zaxis):
        axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
        axis.set_major_locator(plt.MaxNLocator(4))
    space.view_init(elev=22.0, azim=-52.0)
    space.legend(loc="upper center", bbox_to_anchor=(0.54, 0.06), fontsize=8.0)


def _draw_distances(panel: Any, deviations: tuple[Deviation, ...]) -> None:
    """Draw the distances of setpoints and measured tool from the paths over time."""
    measured = commanded = 0.0
    for each in deviations:
        off = 1e3 * each.error
        panel.plot(*_broken(each.t, off), color=ERROR, linewidth=1.0)
        sent = _broken(each.t_commanded, 1e3 * each.commanded)
        panel.plot(*sent, color=AXES[0], linewidth=1.6)
        measured = max(measured, float(off.max()))
        commanded = max(commanded, 1e3 * float(each.commanded.max()))
    panel.set_title("Distance from the path")
    panel.set_ylabel("distance (mm)")
    panel.set_ylim(0.0, 1.5 * measured or 1.0)
    for text, colour, y in (
        (f"measured: up to {measured:.2g} mm", ERROR, 0.98),
        (f"setpoints: up to {commanded:.1g} mm", AXES[0], 0.88),
    ):
        panel.text(0.99, y, text, transform=panel.transAxes, color=colour, fontsize=8.0, **RIGHT)


def _broken(t: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the points of a line that is broken while the arm is on another path."""
    gaps = np.flatnonzero(np.diff(t) > GAP) + 1
    return np.insert(t, gaps, math.nan), np.insert(values, gaps, math.nan)


def _draw_joint_errors(panel: Any, run: MeasuredRun) -> None:
    """Draw measured joints minus where they should have been over time."""
    off = np.degrees(run.q - run.due)
    for axis in range(off.shape[1]):
        panel.plot(
            run.t,
            off[:, axis],
            color=AXES[axis % len(AXES)],
            linewidth=0.9,
            label=f"θ{axis + 1}",
        )
    panel.set_title("Tracking error of the joints")
    panel.set_ylabel("error (deg)")
    panel.set_xlabel(TIME)
    panel.set_xlim(run.t[0], run.t[-1])
    panel.margins(y=0.25)
    panel.legend(
        loc="upper right",
        ncols=off.shape[1],
        fontsize=7.0,
        handlelength=0.8,
        columnspacing=0.7,
        handletextpad=0.4,
    )
