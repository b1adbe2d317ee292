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
        (f"share/{NAME}", ["package.xml", "CHANGELOG.rst", "LICENSE"]),
        (f"share/{NAME}/config", [str(p) for p in sorted(Path("config").iterdir())]),
        (f"share/{NAME}/layouts", [str(p) for p in sorted(Path("layouts").iterdir())]),
        (f"share/{NAME}/launch", [str(p) for p in sorted(Path("launch").glob("*.launch.py"))]),
    ],
    install_requires=["setuptools"],
    extras_require={"test": ["pytest"]},
    entry_points={
        "pam.tools": ["bringup = pam_bringup.__main__:TOOL"],
        "console_scripts": [
            "pam_viewer = pam_bringup.__main__:main",
            "pam_markers = pam_bringup.__main__:markers",
        ],
    },
    zip_safe=False,
    author="PAM suite authors",
    author_email="pam-suite@example.org",
    maintainer="PAM suite maintainers",
    maintainer_email="pam-suite@example.org",
    url="https://example.org/pam-suite",
    description="Launch files and example configuration of the PAM suite.",
    license="Apache-2.0",
)
