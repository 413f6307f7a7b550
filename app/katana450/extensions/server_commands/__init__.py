"""Commands about a running server: who may use it, who is connected, and one motion."""
