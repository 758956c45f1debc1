"""What pyproject.toml cannot say: the configurations in configs/ are shipped as data of mocca_robot.examples."""

from setuptools import find_packages, setup

FOLDERS = {"mocca_robot.examples": "configs"}
FOLDERS |= {f"mocca_robot.examples.{name}": f"configs/{name}" for name in ("models", "cells")}

setup(
    packages=[*find_packages(exclude=["tests*", "benchmarks*", "docs*", "configs*"]), *FOLDERS],
    package_dir=FOLDERS,
    package_data={name: ["*.yaml", "*.svg", "*.obj", "*.json"] for name in FOLDERS}
    | {
        "mocca_robot.report": ["assets/*"],
        "mocca_robot.cli.studio": ["page/*"],
        "mocca_robot.ur": ["*.script"],
        "mocca_robot": ["*.pyi", "py.typed"],
        "planners": ["*.pyi"],
    },
)
