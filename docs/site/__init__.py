"""The documentation site: the Markdown files of the project and a reference of the library."""
