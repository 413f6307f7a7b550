"""Drivers: the connection between setpoints and an arm. One of them simulates an arm."""
