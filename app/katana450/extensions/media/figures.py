"""Figures of a report for print. matplotlib is imported only when one is drawn."""

from __future__ import annotations

import importlib
import io
import math
from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any, Concatenate, ParamSpec

import numpy as np

from katana450.extensions.media.measures import PathTrace, PourRecord
from katana450.extensions.programs.run.simulation import Simulation
from katana450.maths.geometry.arrays import FloatArray

INK, FAINT, DESIRED, ERROR = "#1f2933", "#cbd2d9", "#9aa5b1", "#c2410c"
"""Colours of text, grid, desired paths and errors."""
AXES = ("#0b6e99", "#c2410c", "#2f855a", "#7c3aed", "#a16207", "#be185d", "#475569")
"""Colours of the joints."""

STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.grid": True,
    "grid.color": FAINT,
    "grid.linewidth": 0.5,
    "xtick.color": INK,
    "ytick.color": INK,
    "legend.frameon": False,
    "savefig.dpi": 200,
    "svg.hashsalt": "katana450",
}
"""matplotlib settings of all figures."""

PARTS = 200
"""Number of parts of a path; the largest error of each is drawn."""

ABOVE: dict[str, Any] = {
    "loc": "lower right",
    "bbox_to_anchor": (1.0, 1.0),
    "borderaxespad": 0.0,
    "fontsize": 8.0,
}
"""Place of a legend above the upper right corner."""

TIME = "time (s)"
"""Label of a time axis."""


Drawing = ParamSpec("Drawing")


def as_png(draw: Callable[Concatenate[Any, Drawing], Any]) -> Callable[Drawing, bytes]:
    """Return the function that returns the figure of ``draw`` as a PNG.

    ``draw`` gets matplotlib's module of figures, which draws without a display.
    """

    @wraps(draw)
    def png(*args: Drawing.args, **options: Drawing.kwargs) -> bytes:
        importlib.import_module("matplotlib").use("Agg")
        plt = importlib.import_module("matplotlib.pyplot")
        file = io.BytesIO()
        with plt.rc_context(STYLE):
            figure = draw(plt, *args, **options)
            figure.savefig(file, format="png", metadata={"Software": None})
            plt.close(figure)
        return file.getvalue()

    return png


@as_png
def path_figure(plt: Any, paths: Sequence[PathTrace]) -> Any:
    """Draw desired and traced path in 3D, and the error along it (paper's Fig. 7)."""
    figure = plt.figure(figsize=(7.2, 3.9))
    space = figure.add_axes((0.0, 0.0, 0.52, 0.92), projection="3d")
    panel = figure.add_axes((0.62, 0.15, 0.36, 0.76))
    worst = 1e3 * max(float(path.error.max()) for path in paths)
    power = math.floor(math.log10(worst)) if worst > 0.0 else 0
    for number, path in enumerate(paths):
        desired, traced = 1e3 * path.desired, 1e3 * path.traced
        names = ("desired", "traced") if number == 0 else (None, None)
        space.plot(*desired.T, color=DESIRED, linewidth=4.0, alpha=0.7, label=names[0])
        space.plot(*traced.T, color=AXES[0], linewidth=1.1, label=names[1])
        space.scatter(*desired[0], color=INK, s=14)
    sigma, errors = largest(paths)
    errors = 1e3 * errors / 10.0**power
    panel.fill_between(100.0 * sigma, errors, color=ERROR, alpha=0.15, linewidth=0.0)
    panel.plot(100.0 * sigma, errors, color=ERROR, linewidth=0.8)
    _frame(plt, space, 1e3 * np.concatenate([path.desired for path in paths]))
    figure.text(0.02, 0.931, "Desired and traced path", fontsize=10.0, fontweight="bold")
    space.legend(loc="upper left", bbox_to_anchor=(0.01, 1.0), ncols=2, fontsize=8.0)
    panel.set_title("Position error of the kinematics")
    panel.set_xlabel("along the path (%)")
    panel.set_ylabel(f"error ($10^{{{power}}}$ mm)")
    panel.set_xlim(0.0, 100.0)
    top = worst / 10.0**power
    panel.set_ylim(0.0, 1.25 * top or 1.0)
    panel.axhline(top, color=INK, linewidth=0.7, linestyle=(0, (4, 3)))
    caption = f"largest {top:.1f}$\\times10^{{{power}}}$ mm"
    panel.annotate(caption, (99.0, 1.03 * top), ha="right", va="bottom")
    return figure


def largest(paths: Sequence[PathTrace]) -> tuple[FloatArray, FloatArray]:
    """Return sigma (m,) in the middle of PARTS parts of all paths, and the largest error [m] there.

    Rounding errors jump from place to place, so a plot of all of them would be a block of colour.
    """
    edges = np.linspace(0.0, 1.0, PARTS + 1)
    maximum = np.zeros(PARTS)
    for path in paths:
        part = np.minimum((PARTS * path.sigma).astype(int), PARTS - 1)
        np.maximum.at(maximum, part, path.error)
    return 0.5 * (edges[:-1] + edges[1:]), maximum


@as_png
def joints_figure(plt: Any, run: Simulation) -> Any:
    """Draw the joint variables over time (the paper's Fig. 8)."""
    figure, panel = plt.subplots(figsize=(7.2, 3.6), layout="constrained")
    degrees = np.degrees(run.q)
    draw_joints(panel, run.t, degrees, linewidth=1.4)
    panel.legend(**ABOVE, ncols=degrees.shape[1] + 1, handlelength=1.1, columnspacing=1.0)
    _label(panel, "Joint variables", "angle (deg)", run.t)
    return figure


@as_png
def speeds_figure(plt: Any, run: Simulation) -> Any:
    """Draw joint speeds as fractions of their limits, and of the speed of the tool."""
    figure, (upper, lower) = plt.subplots(
        2, 1, figsize=(7.2, 4.6), sharex=True, layout="constrained", height_ratios=(3, 2)
    )
    fractions = 100.0 * run.qd / run.arm.chain.speed
    draw_joints(upper, run.t, fractions, linewidth=1.2)
    for limit in (-100.0, 100.0):
        upper.axhline(limit, color=ERROR, linewidth=0.8, linestyle=(0, (4, 3)))
    upper.set_ylim(-115.0, 115.0)
    upper.set_title("Joint speeds as fractions of their limits")
    upper.set_ylabel("speed (% of limit)")
    upper.legend(**ABOVE, ncols=fractions.shape[1], handlelength=1.1, columnspacing=1.0)
    tools = [run.arm.kinematics_to(state.tool) for state in run.states]
    rows = zip(tools, run.q, run.qd, strict=True)
    speeds = 1e3 * np.array([tool.tool_speed(q, qd) for tool, q, qd in rows])
    lower.fill_between(run.t, speeds, color=AXES[0], alpha=0.15, linewidth=0.0)
    lower.plot(run.t, speeds, color=AXES[0], linewidth=1.2)
    _label(lower, "Speed of the tool point", "speed (mm/s)", run.t)
    lower.set_ylim(bottom=0.0)
    return figure


@as_png
def water_figure(plt: Any, pour: PourRecord) -> Any:
    """Draw the volumes, the flow, the tilt of the cup and its lip above the water."""
    figure, (upper, lower) = plt.subplots(
        2, 1, figsize=(7.2, 5.0), sharex=True, layout="constrained"
    )
    volumes = (
        ("in the cup", pour.cup),
        ("in the basin", pour.basin),
        ("spilled", pour.spilled),
    )
    lines = [
        upper.plot(pour.t, values, color=colour, linewidth=1.4, label=name)[0]
        for (name, values), colour in zip(volumes, (AXES[0], AXES[2], ERROR), strict=True)
    ]
    upper.set_title("Water")
    upper.set_ylabel("volume (ml)")
    upper.set_ylim(bottom=0.0)
    flow = _second(upper, "flow (ml/s)")
    lines += flow.plot(pour.t, pour.flow, color=AXES[4], linewidth=0.9, label="flow")
    flow.set_ylim(bottom=0.0)
    upper.legend(handles=lines, **ABOVE, ncols=len(lines))
    lines = lower.plot(
        pour.t, np.degrees(pour.tilt), color=AXES[3], linewidth=1.4, label="tilt of the cup"
    )
    _label(lower, "Cup", "tilt (deg)", pour.t)
    lip = _second(lower, "height (mm)")
    name = "lip above the water"
    lines += lip.plot(pour.t, 1e3 * pour.lip, color=AXES[0], linewidth=1.2, label=name)
    lower.legend(handles=lines, **ABOVE, ncols=len(lines))
    return figure


def draw_joints(panel: Any, t: FloatArray, values: FloatArray, **line: Any) -> None:
    """Draw the columns of ``values`` (N, n) over the times ``t`` (N,) [s], named as joints."""
    for axis, column in enumerate(values.T):
        panel.plot(t, column, color=AXES[axis % len(AXES)], label=f"θ{axis + 1}", **line)


def _label(panel: Any, title: str, quantity: str, t: FloatArray) -> None:
    """Name ``panel`` and its ``quantity`` over the times ``t`` (N,) [s]."""
    panel.set_title(title)
    panel.set_ylabel(quantity)
    panel.set_xlabel(TIME)
    panel.set_xlim(t[0], t[-1])


def _second(panel: Any, label: str) -> Any:
    """Return a second axis of values on the right of ``panel``."""
    second = panel.twinx()
    second.spines["right"].set_visible(True)
    second.set_ylabel(label)
    second.grid(visible=False)
    return second


def _frame(plt: Any, space: Any, points: FloatArray) -> None:
    """Label the axes of a plot in space around ``points`` (n, 3) [mm], and set its view."""
    equal_axes(space, points)
    space.set_xlabel("x (mm)")
    space.set_ylabel("y (mm)")
    space.set_zlabel("z (mm)", labelpad=9.0)
    space.view_init(elev=22.0, azim=-52.0)
    for axis in (space.xaxis, space.yaxis, space.zaxis):
        axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
        axis.set_major_locator(plt.MaxNLocator(4))


def equal_axes(space: Any, points: FloatArray) -> None:
    """Set the same scale on all three axes, with a margin around ``points`` (n, 3)."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = 0.5 * (low + high), 0.55 * float((high - low).max())
    for number, set_limits in enumerate((space.set_xlim, space.set_ylim, space.set_zlim)):
        set_limits(middle[number] - half, middle[number] + half)
    space.set_box_aspect((1.0, 1.0, 1.0), zoom=0.86)
