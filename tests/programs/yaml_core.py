"""Reading of YAML as editors do: by version 1.2, in which ``on`` is a text and not true."""

from __future__ import annotations

import re
from typing import Any, ClassVar

import yaml

BOOL = "tag:yaml.org,2002:bool"


class CoreLoader(yaml.SafeLoader):  # type: ignore[misc]  # PyYAML has no types
    """A loader for which only ``true`` and ``false`` are truth values."""

    yaml_implicit_resolvers: ClassVar[dict[str, Any]] = {
        first: [(tag, pattern) for tag, pattern in known if tag != BOOL]
        for first, known in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }


CoreLoader.add_implicit_resolver(BOOL, re.compile("true|True|TRUE|false|False|FALSE"), list("tTfF"))


def loaded(text: str) -> Any:
    return yaml.load(text, CoreLoader)
