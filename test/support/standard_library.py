"""The modules of Python's standard library (sys.stdlib_module_names is Python 3.10's)."""
import os
import pkgutil
import sys
import sysconfig

FOLDER = sysconfig.get_path('stdlib')
STANDARD_LIBRARY = set(sys.builtin_module_names).union(
    module.name for module in pkgutil.iter_modules([FOLDER, os.path.join(FOLDER, 'lib-dynload')]))
