"""The modules of Python's standard library that are in use here (sys.stdlib_module_names is Python 3.10's)."""
STANDARD_LIBRARY = {'argparse', 'ast', 'bisect', 'collections', 'contextlib', 'csv', 'datetime', 'difflib', 'fcntl',
                    'functools', 'html', 'json', 'math', 'os', 'pathlib', 'pickle', 'sys', 'tempfile', 'threading',
                    'time', 'typing', 'zipfile'}
TEST_STANDARD_LIBRARY = {'copy', 'glob', 'importlib', 'io', 'itertools', 'multiprocessing', 'random', 're',
                         'shutil', 'signal', 'stat', 'subprocess', 'types', 'xml'}
