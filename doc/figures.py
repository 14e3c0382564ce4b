"""Write figures that a benchmark measured (--json FILE) to doc/figures.yaml and to the pages that quote them.

Usage: python3 doc/figures.py FILE ...
"""
import json
import os
import re
import sys

import yaml

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))


def value_at(key, result):
    """Value in the result of a benchmark at a key such as cases/depth/p50_ms; a list has names, or numbers."""
    for part in key.split('/'):
        if isinstance(result, list):
            result = {each['name'] if isinstance(each, dict) else str(n): each for n, each in enumerate(result)}
        result = result[part]
    return result


def options_of(command):
    """Benchmark and options of a command, without their values."""
    return set(re.findall(r'(?<=bench )\w+|--\w+', command)) - {'--json'}


def write(result, root=ROOT):
    """Write the figures whose command gave the result of a benchmark. Returns their names."""
    path, written = os.path.join(root, 'doc', 'figures.yaml'), []
    with open(path, encoding='utf-8') as stream:
        figures = yaml.safe_load(stream)
    for name, figure in figures.items():
        if options_of(figure['command']) == options_of(result['command']):
            digits = max(map(int, re.findall(r'\.(\d)f', str(figure['quotes']))), default=0)
            value = round(value_at(figure['key'], result) * figure.get('times', 1), digits or None)
            _replace(path, name + ': value: {}', figure['value'], value)
            for page, quote in figure['quotes'].items():
                _replace(os.path.join(root, page), quote, figure['value'], value)
            written.append(name)
    return written


def _replace(path, quote, old, new):
    """Replace a value at the only place of a file that quotes it; lines may end at any space of the quote."""
    before, shown, after = re.match('(.*)({.*})(.*)', quote).groups()
    parts = (re.escape(text).replace('\\ ', r'\s+') for text in (before, shown.format(old), after))
    with open(path, encoding='utf-8') as stream:
        text, count = re.subn('(%s)%s(%s)' % tuple(parts), lambda found: shown.format(new).join(found.groups()),
                              stream.read())
    if count != 1:
        raise ValueError('%s has %r %d times; once expected' % (path, quote.format(old), count))
    with open(path, 'w', encoding='utf-8') as stream:
        stream.write(text)


if __name__ == '__main__':
    for name in sys.argv[1:]:
        with open(name) as results:
            print(name, *write(json.load(results)))
