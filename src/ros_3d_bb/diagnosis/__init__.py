"""What is wrong with a running graph or a bag, and how to fix it.

May import: bags, camera, conversions, core, msg.
"""
