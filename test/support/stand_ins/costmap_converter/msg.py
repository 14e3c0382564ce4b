from support.planner_definitions import package

globals().update(vars(package('costmap_converter')))
