"""Imports form no cycle, also counting those inside functions and those for type checkers alone."""

from __future__ import annotations

from graphlib import TopologicalSorter

import grimp

LEFT = (
    ("katana450.arm.control.pouring", "katana450.arm.control.scene_objects"),
    ("katana450.arm.control.scene_objects", "katana450.arm.control.state"),
    ("katana450.library.motion_plan", "katana450.library.arm"),
    ("katana450.library.planner", "katana450.library.arm"),
    ("katana450.library.plot", "katana450.library.motion_plan"),
    ("katana450.library.viewer", "katana450.library.arm"),
    ("katana450.library.viewer", "katana450.library.motion_plan"),
)
"""Importing and imported module of the imports for type checkers that still close a circle."""


def test_imports_have_no_circle() -> None:
    # The linter of imports is built on this graph.
    graph = grimp.build_graph("katana450", exclude_type_checking_imports=False, cache_dir=None)
    assert len(graph.modules) > 600
    for importer, imported in LEFT:
        graph.remove_import(importer=importer, imported=imported)
    imports = {name: graph.find_modules_directly_imported_by(name) for name in graph.modules}
    # Raises CycleError with the modules of a circle.
    TopologicalSorter(imports).prepare()
