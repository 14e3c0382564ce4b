from support.planner_definitions import package

globals().update(vars(package('vision_msgs')))
