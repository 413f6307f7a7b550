"""The view: shows states in viser and sends commands of people. It computes nothing."""
