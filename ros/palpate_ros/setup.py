"""Install the package, as colcon calls it."""

from setuptools import setup

NAME = "palpate_ros"

setup(
    name=NAME,
    version="0.1.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", ["launch/palpate.launch.py"]),
        (f"share/{NAME}/config", ["config/palpate.yaml"]),
    ],
    install_requires=["setuptools", "palpate"],
    zip_safe=True,
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            f"identify_contact = {NAME}.node:main",
            f"controller = {NAME}.controller_node:main",
        ]
    },
)
