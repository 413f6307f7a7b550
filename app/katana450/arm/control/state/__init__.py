"""State of a session, its parts, and the words for them."""
