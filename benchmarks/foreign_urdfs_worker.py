"""The places of all links of URDF files, by pinocchio, in an environment without the app.

The first argument is a JSON file with joint values by the path of each file, the second one is
written: the poses (4, 4) of the links, or null for a file that pinocchio does not read.
"""

from __future__ import annotations

import json
import math
import sys
from importlib import import_module
from pathlib import Path
from typing import Any


def places(path: str, postures: list[dict[str, float]]) -> list[dict[str, Any]]:
    """Return the poses of the links at each of the postures."""
    pin: Any = import_module("pinocchio")
    model = pin.buildModelFromUrdf(path)
    data, found = model.createData(), []
    for values in postures:
        q = pin.neutral(model)
        for name, value in values.items():
            if not model.existJointName(name):
                continue
            joint = model.joints[model.getJointId(name)]
            # A joint without limits has the cosine and the sine of its angle.
            numbers = [value] if joint.nq == 1 else [math.cos(value), math.sin(value)]
            q[joint.idx_q : joint.idx_q + joint.nq] = numbers
        pin.framesForwardKinematics(model, data, q)
        bodies = [(k, each) for k, each in enumerate(model.frames) if each.type == pin.BODY]
        found.append({each.name: data.oMf[k].homogeneous.tolist() for k, each in bodies})
    return found


def main(question: str, answer: str) -> None:
    """Answer the question."""
    answers: dict[str, Any] = {}
    for path, postures in json.loads(Path(question).read_text(encoding="utf-8")).items():
        try:
            answers[path] = places(path, postures)
        except Exception as error:
            print(f"{path}: {error}", file=sys.stderr)
            answers[path] = None
    Path(answer).write_text(json.dumps(answers), encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
