"""3D boxes, tracks and predictions of people from an RGB-D camera on a ROS 1 robot."""
from pkgutil import extend_path

__path__ = extend_path(__path__, __name__)  # a catkin workspace has the generated messages in another folder
