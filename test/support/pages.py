"""doc/node_pages.py and doc/figures.py, which are no part of an installed package, as modules."""
import importlib.util
import os
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
DOC = os.path.join(ROOT, 'doc')


def _module(name):
    specification = importlib.util.spec_from_file_location(name, os.path.join(DOC, name + '.py'))
    module = importlib.util.module_from_spec(specification)
    sys.modules[name] = module  # its types ask for their module
    specification.loader.exec_module(module)
    return module


node_pages, figures = _module('node_pages'), _module('figures')
