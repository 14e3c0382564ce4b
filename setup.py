from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import find_packages, setup

setup(**generate_distutils_setup(
    packages=find_packages('src') + find_packages('annotator'),
    package_dir={'': 'src', 'ros_3d_bb_annotator': 'annotator/ros_3d_bb_annotator'}))
