"""doc/node_pages.py, which is no part of an installed package, as a module."""
import os
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
DOC = os.path.join(ROOT, 'doc')
sys.path.insert(0, DOC)
import node_pages  # noqa: E402,F401 (needs the path)
