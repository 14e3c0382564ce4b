"""The modules of Python's standard library that the package may import (sys.stdlib_module_names is Python 3.10's)."""
STANDARD_LIBRARY = {'argparse', 'ast', 'bisect', 'collections', 'contextlib', 'difflib', 'json', 'math', 'os', 'pickle',
                    'sys', 'threading', 'time', 'typing', 'zipfile'}
