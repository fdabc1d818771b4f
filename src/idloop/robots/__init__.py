"""Whole robots: rigid-body dynamics from a URDF, every joint of a JointState record, and what each joint lacks."""
