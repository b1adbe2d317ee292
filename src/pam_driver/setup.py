"""Installs pam_driver; package.xml says which version it is and who made it."""

import xml.etree.ElementTree as ET

from setuptools import find_packages, setup

NAME = "pam_driver"
ABOUT = ET.parse("package.xml").getroot()
VERSION = ABOUT.findtext("version")
AUTHOR, MAINTAINER = ABOUT.find("author"), ABOUT.find("maintainer")

setup(
    name=NAME,
    version=VERSION,
    packages=find_packages(),
    package_data={"": ["py.typed", "*.dbc", "profiles/*.eds"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml", "CHANGELOG.rst", "LICENSE"]),
        (f"share/{NAME}/config", ["pam_driver/boards/pam_board/pam_board.dbc"]),
    ],
    install_requires=[
        "canopen>=2.3",
        "cantools>=39",
        "msgpack>=1.0",
        "numpy>=1.26",
        f"pam_cli=={VERSION}",
        f"pam_model=={VERSION}",
        f"pam_ros=={VERSION}",
        "python-can>=4.3.1",
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
        "pam.tools": ["driver = pam_driver.__main__:TOOL"],
        "console_scripts": [
            "pam_driver = pam_driver.__main__:main",
            "pam_driver_node = pam_driver.__main__:driver_node",
        ],
    },
)
