"""Tracks for planners: conversion to the planner's frame, and the outputs of planner_bridge_node.

May import: camera, conversions, core, tracking.
"""
