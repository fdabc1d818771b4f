"""What stands between a command and a motor: limits, the gate, the guardian, the robot's side."""
