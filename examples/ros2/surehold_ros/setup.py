from setuptools import setup

setup(
    name="surehold_ros",
    version="0.2.0",
    packages=["surehold_ros"],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/surehold_ros"]),
        ("share/surehold_ros", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    entry_points={
        "console_scripts": [
            "explorer = surehold_ros.explorer:main",
            "grasp_planner = surehold_ros.grasp_planner:main",
            "tuner = surehold_ros.tuner:main",
        ]
    },
)
