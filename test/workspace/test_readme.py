"""Files, launch arguments and messages that the README and doc/ name exist. Other test_readme_*.py run the commands."""
import ast
import glob
import os
import re
import xml.etree.ElementTree as ElementTree

import pytest

from support.code_blocks import PAGES, ROOT

NAMED = PAGES + ('doc/error_model.md',)  # its blocks are the record of a campaign
FORMAT = re.compile(r'%[-+\d.]*[a-zA-Z]')


def text_of(path):
    with open(os.path.join(ROOT, path), encoding='utf-8') as stream:
        return stream.read()


def prose_of(page):
    """A page without its blocks of code."""
    return re.sub(r'^```.*?^```$', '', text_of(page), flags=re.DOTALL | re.MULTILINE)


def cells_of(line):
    return [cell.strip() for cell in re.split(r' \|(?= )', line.strip('|'))]


def rows_below(page, header):
    """Cells of the rows of the table with this first line."""
    lines = text_of(page).split(header + '\n')[1].splitlines()[1:]
    ends = [number for number, line in enumerate(lines) if not line.startswith('|')] + [len(lines)]
    return [cells_of(line) for line in lines[:ends[0]]]


def test_messages_in_the_table_of_symptoms_are_in_the_code():
    """`…` replaces values, in the code conversion specifiers."""
    texts = []
    for path in glob.glob(os.path.join(ROOT, 'src', '**', '*.py'), recursive=True):
        for node in ast.walk(ast.parse(text_of(path))):
            text = getattr(node, 'value', getattr(node, 's', None))  # `s` before Python 3.8
            if isinstance(text, str):
                texts.append(FORMAT.sub('…', text))
    rows = rows_below('doc/troubleshooting.md', '| what you see | cause | what to do |')
    quoted = [message for row in rows for message in re.findall(r'`([^`]+)`', row[0]) if ' ' in message]
    assert len(quoted) > 10
    assert [message for message in quoted if not any(message in text for text in texts)] == []


@pytest.mark.parametrize('page', NAMED)
def test_named_files_and_launch_arguments_exist(page):
    known = set(argument.get('name') for path in glob.glob(os.path.join(ROOT, 'launch', '*'))
                for argument in ElementTree.parse(path).iter('arg'))
    for code in re.findall(r'`([^`\n]+)`', prose_of(page)):
        for path in re.findall(r'(?:^|\s)((?:config|doc|launch|msg|rviz|src|test|urdf|worlds)/[\w./]*\w)$', code):
            assert glob.glob(os.path.join(ROOT, path)), path
        if ' ' not in code and not code.startswith('-'):
            assert set(re.findall(r'\b([a-z]\w*):=', code)) - known == set(), code
