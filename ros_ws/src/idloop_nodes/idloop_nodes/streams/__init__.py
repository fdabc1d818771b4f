"""Streams of samples: matched, watched, kept and written. No ROS in most of it."""
