"""Detectors in ONNX files of any family: heads, preprocessing, and ONNX Runtime."""
