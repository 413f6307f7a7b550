"""The documentation site: its pages are the Markdown files of the project and a reference of the library."""
