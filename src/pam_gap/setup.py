"""Installs pam_gap; package.xml says which version it is and who made it."""

import xml.etree.ElementTree as ET

from setuptools import find_packages, setup

NAME = "pam_gap"
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
        "backports-zstd>=1.0",
        "bokeh>=3.4",
        "h5py>=3.10",
        "jinja2>=3.1",
        "matplotlib>=3.6",
        "numpy>=1.26",
        f"pam_cli=={VERSION}",
        f"pam_model=={VERSION}",
        f"pam_ros=={VERSION}",
        "pandas>=2.1",
        "pyyaml>=6.0",
        "rich>=13.7",
        "rosbags>=0.11",
        "scipy>=1.11",
    ],
    extras_require={
        "compiled": [f"pam_model[compiled]=={VERSION}"],
        "fleet": ["dask>=2024.1", "distributed>=2024.1", "pyarrow>=14"],
        "parquet": ["pyarrow>=14"],
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
        "pam.tools": ["gap = pam_gap.__main__:TOOL"],
        "console_scripts": [
            "pam_gap = pam_gap.__main__:main",
            "pam_diagnose = pam_gap.__main__:diagnose",
            "pam_monitor = pam_gap.__main__:monitor",
            "pam_play = pam_gap.__main__:play",
        ],
    },
)
