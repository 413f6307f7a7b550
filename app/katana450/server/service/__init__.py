"""Requests of people and programs: who may drive, and what the arm does for them."""
