"""YOLOv5 without its code: checkpoint, network, and backends of torch and ONNX Runtime."""
