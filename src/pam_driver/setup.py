"""Installs pam_driver the way ament_python expects it."""

from setuptools import find_packages, setup

NAME = "pam_driver"

setup(
    name=NAME,
    version="0.1.0",
    packages=find_packages(),
    package_data={"": ["py.typed", "*.dbc", "profiles/*.eds"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml", "CHANGELOG.rst", "LICENSE"]),
        (f"share/{NAME}/config", ["pam_driver/boards/pam_board/pam_board.dbc"]),
    ],
    install_requires=["setuptools"],
    extras_require={"test": ["pytest"]},
    zip_safe=False,
    author="PAM suite authors",
    author_email="pam-suite@example.org",
    maintainer="PAM suite maintainers",
    maintainer_email="pam-suite@example.org",
    url="https://example.org/pam-suite",
    description="CAN bus driver for the valve boards of pneumatic artificial muscles.",
    license="Apache-2.0",
    entry_points={
        "pam.tools": ["driver = pam_driver.__main__:TOOL"],
        "console_scripts": [
            "driver_node = pam_driver.__main__:driver_node",
        ],
    },
)
