"""The HTTP server: routes, authentication, limits, and the sockets of pages and programs."""
