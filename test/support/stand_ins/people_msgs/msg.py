from support.planner_definitions import package

globals().update(vars(package('people_msgs')))
