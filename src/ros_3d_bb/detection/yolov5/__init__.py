"""YOLOv5 without its code: checkpoint, network, and backends of torch and ONNX Runtime.

May import: core, detection, detection.onnx.
"""
