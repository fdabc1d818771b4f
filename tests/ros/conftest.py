"""ROS for tests: its packages imported once, without the warnings of their own imports."""

from __future__ import annotations

import contextlib
import warnings

with warnings.catch_warnings(), contextlib.suppress(ImportError):
    warnings.simplefilter("ignore")
    import rclpy.serialization
    from diagnostic_msgs.msg import DiagnosticArray
    from sensor_msgs.msg import JointState

    for message in (DiagnosticArray, JointState):
        rclpy.serialization.serialize_message(message())  # loads the type support
