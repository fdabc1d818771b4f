"""Thin ROS 2 nodes around the idloop library: messages to arrays, a library call, the answer to messages."""

__version__ = "0.1.0"
