"""What planners read of tracks: the view in their frame, and the outputs of planner_bridge_node.

May import: camera, conversions, core, tracking.
"""
