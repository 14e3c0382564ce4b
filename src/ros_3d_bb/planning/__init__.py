"""Tracks for planners: conversion to the planner's frame, and the outputs of planner_bridge_node."""
