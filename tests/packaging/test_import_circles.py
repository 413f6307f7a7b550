"""Imports form no cycle, also counting those inside functions and those for type checkers alone."""

from __future__ import annotations

from graphlib import TopologicalSorter

import grimp


def test_imports_have_no_circle() -> None:
    # The linter of imports is built on this graph.
    graph = grimp.build_graph("katana450", exclude_type_checking_imports=False, cache_dir=None)
    assert len(graph.modules) > 400
    imports = {name: graph.find_modules_directly_imported_by(name) for name in graph.modules}
    # Raises CycleError with the modules of a circle.
    TopologicalSorter(imports).prepare()
