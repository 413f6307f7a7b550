"""Pictures, films and reports of runs, without a browser; the same bytes on every run."""
