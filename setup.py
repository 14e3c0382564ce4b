from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(
    packages=['ros_3d_bb', 'ros_3d_bb.bags', 'ros_3d_bb.camera', 'ros_3d_bb.conversions', 'ros_3d_bb.core',
              'ros_3d_bb.detection', 'ros_3d_bb.detection.depth', 'ros_3d_bb.detection.onnx',
              'ros_3d_bb.detection.yolov5', 'ros_3d_bb.diagnosis', 'ros_3d_bb.drivers', 'ros_3d_bb.estimation',
              'ros_3d_bb.nodes', 'ros_3d_bb.nodes.common',
              'ros_3d_bb.pipeline', 'ros_3d_bb.planning', 'ros_3d_bb.sessions', 'ros_3d_bb.tracking',
              'ros_3d_bb.visualization', 'ros_3d_bb_lab', 'ros_3d_bb_lab.evaluation',
              'ros_3d_bb_lab.evaluation.baselines', 'ros_3d_bb_lab.evaluation.costmap',
              'ros_3d_bb_lab.evaluation.demo', 'ros_3d_bb_lab.evaluation.gazebo',
              'ros_3d_bb_lab.evaluation.latency',
              'ros_3d_bb_lab.evaluation.navigation', 'ros_3d_bb_lab.evaluation.noise',
              'ros_3d_bb_lab.evaluation.tracking', 'ros_3d_bb_lab.simulation', 'ros_3d_bb_lab.simulation.ros',
              'ros_3d_bb_annotator'],
    package_dir={'': 'src', 'ros_3d_bb_annotator': 'annotator/ros_3d_bb_annotator'}))
