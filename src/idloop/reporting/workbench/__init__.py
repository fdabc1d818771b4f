"""The workbench: one browser page that shows what is measured, where the model fails and what it lacks.

No ROS in here: the page gets plain objects through `idloop.reporting.workbench.state`, which a node or the verb
`idloop workbench` provides.
"""
