"""Installs pam_model; package.xml says which version it is and who made it."""

import xml.etree.ElementTree as ET

from setuptools import find_packages, setup

NAME = "pam_model"
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
    ],
    install_requires=[
        "argcomplete>=3.1",
        "matplotlib>=3.6",
        "numpy>=1.26",
        f"pam_ros=={VERSION}",
        "pyyaml>=6.0",
        "scipy>=1.11",
        "tqdm>=4.66",
    ],
    extras_require={
        "compiled": ["numba>=0.59"],
        "mujoco": ["mujoco-core>=4.0"],
        "ros": [f"pam_ros[ros]=={VERSION}"],
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
    entry_points={
        "pam.tools": ["model = pam_model.__main__:TOOL"],
        "console_scripts": [
            "pam_model = pam_model.__main__:main",
            "pam_model_node = pam_model.__main__:model_node",
        ],
    },
)
