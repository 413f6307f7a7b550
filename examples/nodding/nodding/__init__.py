"""An extension in a distribution of its own: a request of the API, and a script step."""

from katana450.sdk import Extension

EXTENSION = Extension("nodding", handler="nodding.nodder:Nodder", step="nodding.nod_step:NodStep")
