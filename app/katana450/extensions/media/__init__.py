"""Pictures, films and reports of runs, without a browser; the same input gives the same bytes."""
