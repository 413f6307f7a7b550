"""The methods of ``EpisodeClient`` that send one request each, derived from the classes of these.

``episode_acts.pyi`` beside this file has their signatures for editors and type checkers.
"""

from __future__ import annotations

from typing import get_args

from katana450.client.acts import add_method
from katana450.server.api.episode_requests import AnyEpisodeRequest

METHODS = {kind.__struct_config__.tag: kind for kind in get_args(AnyEpisodeRequest)}
"""Class of the request of each method."""


class EpisodeActs:
    """One method for each request about episodes; it returns the number of the episode."""


for name, kind in METHODS.items():
    add_method(EpisodeActs, name, kind, "ask")
