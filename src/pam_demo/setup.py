"""Installs pam_demo; package.xml says which version it is and who made it."""

import xml.etree.ElementTree as ET

from setuptools import find_packages, setup

NAME = "pam_demo"
ABOUT = ET.parse("package.xml").getroot()
VERSION = ABOUT.findtext("version")
AUTHOR, MAINTAINER = ABOUT.find("author"), ABOUT.find("maintainer")

setup(
    name=NAME,
    version=VERSION,
    packages=find_packages(),
    package_data={"": ["py.typed", "data/*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml", "CHANGELOG.rst", "LICENSE"]),
    ],
    install_requires=[
        "matplotlib>=3.6",
        "numpy>=1.26",
        f"pam_cli=={VERSION}",
        f"pam_control=={VERSION}",
        f"pam_driver=={VERSION}",
        f"pam_gap=={VERSION}",
        f"pam_model=={VERSION}",
        f"pam_robot=={VERSION}",
        f"pam_ros=={VERSION}",
        f"pam_sim=={VERSION}",
        "pandas>=2.1",
        "rich>=13.7",
        "scipy>=1.11",
    ],
    extras_require={"ros": [f"pam_ros[ros]=={VERSION}"], "test": ["pytest"]},
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
    entry_points={
        "pam.tools": ["demo = pam_demo.__main__:TOOL"],
        "console_scripts": [
            "pam_demo = pam_demo.__main__:main",
        ],
    },
)
