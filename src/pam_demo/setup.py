"""Installs pam_demo the way ament_python expects it."""

from setuptools import find_packages, setup

NAME = "pam_demo"

setup(
    name=NAME,
    version="0.1.0",
    packages=find_packages(),
    package_data={"": ["py.typed", "data/*", "*.j2"]},
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
    description="The demo of the PAM suite, and the closed loop from diagnosis to better tracking.",
    license="Apache-2.0",
    entry_points={
        "pam.tools": ["demo = pam_demo.__main__:TOOL"],
        "console_scripts": [
            "pam_demo = pam_demo.__main__:main",
        ],
    },
)
