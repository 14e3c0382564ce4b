from support.planner_definitions import package

globals().update(vars(package('derived_object_msgs')))
