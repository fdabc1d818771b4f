"""One set-up for pip (scripts in bin/) and colcon (scripts in lib/idloop_nodes/)."""

from setuptools import find_packages, setup

EXECUTABLES = (
    "excitation",
    "controller",
    "bridge",
    "guardian",
    "plant",
    "mujoco_plant",
    "recorder",
    "estimator",
    "replay",
    "workbench",
)

setup(
    name="idloop_nodes",
    version="0.1.0",
    description="ROS 2 nodes of idloop: excite, control, simulate, record, identify",
    license="Apache-2.0",
    packages=find_packages(include=["idloop_nodes", "idloop_nodes.*"]),
    package_data={"idloop_nodes": ["py.typed", "*.xml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/idloop_nodes"]),
        ("share/idloop_nodes", ["package.xml"]),
    ],
    python_requires=">=3.10",
    install_requires=["numpy"],
    zip_safe=False,
    entry_points={
        "console_scripts": [f"{name} = idloop_nodes.executables:{name}" for name in EXECUTABLES],
    },
)
