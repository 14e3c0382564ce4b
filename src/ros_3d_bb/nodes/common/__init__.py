"""What nodes share: parameters, subscribers, tf lookup, diagnostics, reconfigure, the master.

May import: camera, conversions, core, diagnosis, msg, pipeline, visualization.
"""
