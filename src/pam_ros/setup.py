"""Installs pam_ros; package.xml says which version it is and who made it."""

import xml.etree.ElementTree as ET

from setuptools import find_packages, setup

NAME = "pam_ros"
ABOUT = ET.parse("package.xml").getroot()
VERSION = ABOUT.findtext("version")
AUTHOR, MAINTAINER = ABOUT.find("author"), ABOUT.find("maintainer")

setup(
    name=NAME,
    version=VERSION,
    packages=find_packages(),
    package_data={"": ["py.typed", "*.xml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml", "CHANGELOG.rst", "LICENSE"]),
    ],
    install_requires=[
        "pyyaml>=6.0",
    ],
    extras_require={
        "ros": ["ros-jazzy-rclpy[fastrtps]>=7.1.5", "ros-jazzy-common-interfaces>=5.3.6"],
        "test": ["pytest"],
    },
    zip_safe=False,
    author=AUTHOR.text,
    author_email=AUTHOR.get("email"),
    maintainer=MAINTAINER.text,
    maintainer_email=MAINTAINER.get("email"),
    description=ABOUT.findtext("description"),
    long_description=ABOUT.findtext("description"),
    long_description_content_type="text/plain",
    license=ABOUT.findtext("license"),
    python_requires=">=3.12",
)
