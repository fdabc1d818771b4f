"""One set-up for pip (scripts in bin/) and colcon (scripts in lib/idloop_nodes/)."""

from pathlib import Path

from setuptools import find_packages, setup

# One executable for each module of nodes/.
EXECUTABLES = sorted(one.stem for one in Path(__file__).parent.glob("idloop_nodes/nodes/[a-z]*.py"))
VERSIONS = ("3.10", "3.11", "3.12", "3.13", "3.14")  # 64-bit x86 and Arm: all dependencies have wheels for both

setup(
    name="idloop_nodes",
    version="0.1.0",
    description="ROS 2 nodes of idloop: excite, control, simulate, record, identify",
    license="Apache-2.0",
    classifiers=[f"Programming Language :: Python :: {version}" for version in VERSIONS],
    packages=find_packages(include=["idloop_nodes", "idloop_nodes.*"]),
    package_data={"idloop_nodes": ["py.typed", "*.xml", "descriptions/*.yaml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/idloop_nodes"]),
        ("share/idloop_nodes", ["package.xml"]),
    ],
    python_requires=">=3.10",
    install_requires=["numpy"],
    extras_require={"test": ["pytest"]},  # colcon test runs pytest where it is named here
    zip_safe=False,
    entry_points={"console_scripts": [f"{name} = idloop_nodes.executables:{name}" for name in EXECUTABLES]},
)
