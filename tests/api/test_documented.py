"""The page about the API says what the API is."""

from __future__ import annotations

import json

from docs.api import PAGE, page
from katana450.server.api import answers, requests, schema
from katana450.server.api.fields import tag_of


def test_the_page_is_what_the_shapes_say() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "run `python -m docs.api`"


def test_every_message_is_on_it_with_a_sentence() -> None:
    said = PAGE.read_text(encoding="utf-8")
    for union, tag in ((requests.AnyRequest, "do"), (answers.AnyAnswer, "is")):
        for kind in schema.kinds(union):
            assert f'### `"{tag}": "{tag_of(kind.__name__)}"`' in said
            assert len(schema.summary(kind)) > 5, kind


def test_the_description_for_tools_holds_together() -> None:
    described = json.loads(schema.openapi_json())
    text = json.dumps(described)
    named = text.split("#/components/schemas/")[1:]
    assert len(named) > 20
    for reference in {part.partition('"')[0] for part in named}:
        assert reference in described["components"]["schemas"]
