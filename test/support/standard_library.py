"""The modules of Python's standard library that are in use here (sys.stdlib_module_names is Python 3.10's)."""
STANDARD_LIBRARY = {'argparse', 'ast', 'bisect', 'collections', 'contextlib', 'copy', 'csv', 'datetime', 'difflib',
                    'fcntl', 'functools', 'html', 'importlib', 'io', 'json', 'math', 'os', 'pathlib', 'pickle', 're',
                    'sys', 'tempfile', 'threading', 'time', 'typing', 'zipfile'}
TEST_STANDARD_LIBRARY = {'glob', 'itertools', 'multiprocessing', 'random', 'shutil', 'signal', 'stat', 'subprocess',
                         'types', 'xml'}
