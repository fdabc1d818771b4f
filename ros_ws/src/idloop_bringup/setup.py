"""Installs launch files and configurations where ROS looks for them."""

from pathlib import Path

from setuptools import setup


def files(pattern: str) -> list[str]:
    """Return the files of a pattern below this folder, as setuptools wants them."""
    return sorted(str(path) for path in Path().glob(pattern))


setup(
    name="idloop_bringup",
    version="0.1.0",
    description="Launch files and configurations of the idloop graphs",
    license="Apache-2.0",
    packages=[],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/idloop_bringup"]),
        ("share/idloop_bringup", ["package.xml"]),
        ("share/idloop_bringup/launch", files("launch/*.launch.yaml")),
        ("share/idloop_bringup/launch/include", files("launch/include/*.launch.yaml")),
        ("share/idloop_bringup/config", [*files("config/*.yaml"), *files("config/*.xml"), *files("config/*.json")]),
    ],
    python_requires=">=3.10",
    zip_safe=False,
)
