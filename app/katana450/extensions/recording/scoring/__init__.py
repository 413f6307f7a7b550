"""Measures of recordings, and tables and pages that compare them."""
