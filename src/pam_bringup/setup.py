"""Installs pam_bringup the way ament_python expects it."""

from pathlib import Path

from setuptools import find_packages, setup

NAME = "pam_bringup"

setup(
    name=NAME,
    version="0.1.0",
    packages=find_packages(),
    package_data={"": ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/config", ["../../config/elbow.yaml"]),
        (f"share/{NAME}/launch", [str(p) for p in sorted(Path("launch").glob("*.launch.py"))]),
    ],
    install_requires=["setuptools"],
    extras_require={"test": ["pytest"]},
    zip_safe=False,
    maintainer="PAM suite maintainers",
    maintainer_email="pam-suite@example.org",
    description="Launch files that put the nodes of the PAM suite together.",
    license="Apache-2.0",
    entry_points={"console_scripts": []},
)
