"""Messages between the server and its clients: API version 1."""
