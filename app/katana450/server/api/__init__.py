"""What is said between the server and those who speak to it: version 1."""
