"""The modules of Python's standard library that are in use here (sys.stdlib_module_names is Python 3.10's)."""
STANDARD_LIBRARY = {'argparse', 'ast', 'base64', 'bisect', 'collections', 'concurrent', 'contextlib', 'copy', 'csv',
                    'ctypes', 'datetime', 'difflib', 'fcntl', 'functools', 'glob', 'hashlib', 'html', 'http',
                    'importlib', 'io', 'itertools', 'json', 'math', 'multiprocessing', 'os', 'pathlib', 'pickle',
                    'pkgutil', 'platform', 're', 'resource', 'signal', 'socket', 'struct', 'subprocess', 'sys',
                    'tempfile', 'threading', 'time', 'typing', 'urllib', 'warnings', 'weakref', 'xmlrpc', 'zipfile',
                    'zlib'}
TEST_STANDARD_LIBRARY = {'atexit', 'bz2', 'filecmp', 'operator', 'queue', 'random', 'shutil', 'stat',
                         'types', 'unittest', 'xml'}
