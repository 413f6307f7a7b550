"""Programs on a running server: planning in a thread, execution as a participant, previews."""
