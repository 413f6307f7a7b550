"""Rigid bodies that fall, slide, roll and are pushed or held by friction."""
