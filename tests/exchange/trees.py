"""URDF files of artificial mechanisms: trees with prismatic, continuous and mimic joints."""

from __future__ import annotations

import numpy as np


def tree(seed: int, links: int = 8) -> str:
    """Return a chain of links with branches; its joints are j1, j2, ..., and it starts at link0."""
    random = np.random.default_rng(seed)
    kinds = ["prismatic", "revolute", "continuous", "revolute"]
    parts = ['<robot name="tree">', '<link name="link0"/>']
    driven: list[int] = []

    def between(low: float, high: float) -> float:
        return float(random.uniform(low, high))

    for number in range(1, links):
        # Two joints on link0, so that there is always a branch.
        parent = 0 if number <= 2 else int(random.integers(0, number))
        kind = kinds[(number - 1) % len(kinds)]
        follows = number > 4 and number % 2 == 1
        xyz, rpy = random.uniform(-0.2, 0.2, 3), random.uniform(-3.0, 3.0, 3)
        axis = random.normal(size=3)
        size = random.uniform(0.02, 0.1, 3)
        parts.append(
            f'<link name="link{number}"><visual><geometry><box size="{_row(size)}"/></geometry>'
            "</visual></link>"
            f'<joint name="j{number}" type="{kind}"><parent link="link{parent}"/>'
            f'<child link="link{number}"/><origin xyz="{_row(xyz)}" rpy="{_row(rpy)}"/>'
            f'<axis xyz="{_row(axis / np.linalg.norm(axis))}"/>'
            f'<limit lower="{-between(0.1, 0.5)}" upper="{between(0.1, 0.5)}" '
            f'velocity="{between(2.0, 4.0)}" effort="1"/>'
        )
        if follows:
            leader, factor = driven[number % len(driven)], between(-0.9, 0.9)
            parts.append(f'<mimic joint="j{leader}" multiplier="{factor}" offset="0.01"/>')
        else:
            driven.append(number)
        parts.append("</joint>")
    return "\n".join([*parts, "</robot>\n"])


def _row(numbers: np.ndarray[tuple[int], np.dtype[np.float64]]) -> str:
    return " ".join(map(repr, numbers.tolist()))
