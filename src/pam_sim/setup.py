"""Installs pam_sim; package.xml says which version it is and who made it."""

import xml.etree.ElementTree as ET

from setuptools import find_packages, setup

NAME = "pam_sim"
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
        "canopen>=2.3",
        "cantools>=39",
        "numpy>=1.26",
        f"pam_cli=={VERSION}",
        f"pam_driver=={VERSION}",
        f"pam_model=={VERSION}",
        f"pam_ros=={VERSION}",
    ],
    extras_require={
        "gymnasium": ["gymnasium>=1.0", f"pam_model[compiled]=={VERSION}"],
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
        "pam.tools": ["sim = pam_sim.__main__:TOOL"],
        "console_scripts": [
            "pam_sim = pam_sim.__main__:main",
            "pam_rig = pam_sim.__main__:rig_node",
        ],
    },
)
