"""Diagnosis of a running graph or a bag: observations, checks, and findings with suggested fixes."""
