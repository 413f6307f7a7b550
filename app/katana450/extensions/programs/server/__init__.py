"""Programs on a running server: planned in a thread, run as a participant, shown in the panel."""
