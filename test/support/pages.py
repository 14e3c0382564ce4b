"""doc/node_pages.py and doc/figures.py, which are no part of an installed package, as modules."""
import os
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
DOC = os.path.join(ROOT, 'doc')
sys.path.insert(0, DOC)
import figures  # noqa: E402,F401 (needs the path)
import node_pages  # noqa: E402,F401
