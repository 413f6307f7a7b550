"""The event log on disk: chained records, their files, their writer, and their verification."""
