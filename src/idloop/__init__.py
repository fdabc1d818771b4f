"""idloop: identification in the loop for servo axes on ROS 2."""

__version__ = "0.1.0"
