"""Exports of recordings: tables, datasets for training, ROS 2 bags, pages and films."""
