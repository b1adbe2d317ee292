"""Installs pam_bringup; package.xml says which version it is and who made it."""

import xml.etree.ElementTree as ET
from pathlib import Path

from setuptools import find_packages, setup

NAME = "pam_bringup"
ABOUT = ET.parse("package.xml").getroot()
VERSION = ABOUT.findtext("version")
AUTHOR, MAINTAINER = ABOUT.find("author"), ABOUT.find("maintainer")

setup(
    name=NAME,
    version=VERSION,
    packages=find_packages(),
    package_data={"": ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml", "CHANGELOG.rst", "LICENSE"]),
        (f"share/{NAME}/config", [str(p) for p in sorted(Path("config").iterdir())]),
        (f"share/{NAME}/layouts", [str(p) for p in sorted(Path("layouts").iterdir())]),
        (f"share/{NAME}/launch", [str(p) for p in sorted(Path("launch").glob("*.launch.py"))]),
    ],
    install_requires=[
        f"pam_cli=={VERSION}",
        f"pam_control=={VERSION}",
        f"pam_demo=={VERSION}",
        f"pam_driver=={VERSION}",
        f"pam_gap=={VERSION}",
        f"pam_model=={VERSION}",
        f"pam_ros=={VERSION}",
        f"pam_sim=={VERSION}",
        "rosbags>=0.11",
    ],
    extras_require={
        "ros": [f"pam_ros[ros]=={VERSION}"],
        "test": ["pytest"],
        "viewer": ["rerun-sdk==0.41.0"],
    },
    entry_points={
        "pam.tools": ["bringup = pam_bringup.__main__:TOOL"],
        "console_scripts": [
            "pam_bringup = pam_bringup.__main__:main",
            "pam_viewer = pam_bringup.__main__:main",
            "pam_markers = pam_bringup.__main__:markers",
        ],
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
