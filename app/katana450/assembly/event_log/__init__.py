"""The event log on disk: records, their files, their writer, and the command that shows them."""
