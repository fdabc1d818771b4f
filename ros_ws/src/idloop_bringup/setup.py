"""Installs launch files and configurations where ROS looks for them."""

from glob import glob

from setuptools import setup

setup(
    name="idloop_bringup",
    version="0.1.0",
    description="Launch files and configurations of the idloop graphs",
    license="Apache-2.0",
    packages=[],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/idloop_bringup"]),
        ("share/idloop_bringup", ["package.xml"]),
        ("share/idloop_bringup/launch", glob("launch/*.launch.yaml")),
        ("share/idloop_bringup/config", glob("config/*.yaml")),
    ],
    python_requires=">=3.10",
    zip_safe=False,
)
