"""The classes of ROS messages by their names."""
import importlib


def message_class(name):
    """The class of a message such as 'std_msgs/Header'. Raises ImportError or AttributeError where there is none."""
    package, kind = name.split('/')
    return getattr(importlib.import_module(package + '.msg'), kind)
