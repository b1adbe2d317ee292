"""Installs pam_cli. It has no setup.cfg, so that colcon puts its command on the PATH.

The programs of the other packages belong into lib/<package>, where `ros2 run` looks for them.
"""

from setuptools import find_packages, setup

NAME = "pam_cli"

setup(
    name=NAME,
    version="0.1.0",
    packages=find_packages(),
    package_data={"": ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml", "CHANGELOG.rst", "LICENSE"]),
    ],
    install_requires=["setuptools"],
    extras_require={"test": ["pytest"]},
    zip_safe=False,
    author="PAM suite authors",
    author_email="pam-suite@example.org",
    maintainer="PAM suite maintainers",
    maintainer_email="pam-suite@example.org",
    url="https://example.org/pam-suite",
    description="The command pam: tools and nodes of the PAM suite by name.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "pam = pam_cli.__main__:main",
        ]
    },
)
