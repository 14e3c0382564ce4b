"""What tests of meshes share."""
from collections import Counter


def directed_edges(faces):
    return Counter((a, b) for face in faces.tolist() for a, b in zip(face, face[1:] + face[:1]))


def assert_closed(faces):
    """Every edge belongs to two faces, which run along it in opposite directions."""
    edges = directed_edges(faces)
    assert set(edges.values()) == {1}
    assert {(b, a) for a, b in edges} == set(edges)
