"""Descriptions of the API for programs: OpenAPI of HTTP, AsyncAPI of websocket and TCP port."""
