"""The server: requests and who may make them, the web, and the viser scene."""
