"""doc/node_pages.py, which is no part of an installed package, as a module."""
import importlib.util
import os
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
DOC = os.path.join(ROOT, 'doc')

_specification = importlib.util.spec_from_file_location('node_pages', os.path.join(DOC, 'node_pages.py'))
node_pages = importlib.util.module_from_spec(_specification)
sys.modules['node_pages'] = node_pages  # its types ask for their module
_specification.loader.exec_module(node_pages)
