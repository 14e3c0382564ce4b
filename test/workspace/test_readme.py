"""Files, launch arguments and messages that the README and doc/ name exist. Other test_readme_*.py run the commands."""
import ast
import glob
import os
import re
import xml.etree.ElementTree as ElementTree

import pytest
import yaml

from support.code_blocks import PAGES, ROOT

NAMED = PAGES + ('doc/error_model.md',)  # its blocks are the record of a campaign
FORMAT = re.compile(r'%[-+\d.]*[a-zA-Z]')
with open(os.path.join(ROOT, 'doc', 'figures.yaml'), encoding='utf-8') as _stream:
    FIGURES = yaml.safe_load(_stream)


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


@pytest.mark.parametrize('name', sorted(FIGURES))
def test_pages_quote_the_measured_figure(name):
    for page, quote in FIGURES[name]['quotes'].items():
        assert quote.format(FIGURES[name]['value']) in ' '.join(text_of(page).split()), page


def test_each_bold_figure_of_the_readme_is_a_measured_one():
    section = text_of('README.md').split('## Accuracy and speed\n')[1].split('\n## ')[0]
    quotes = [figure['quotes']['README.md'].format(figure['value']) for figure in FIGURES.values()
              if 'README.md' in figure['quotes']]
    bold = re.findall(r'\*\*[\d.]+', section)
    assert len(bold) >= 10 and [each for each in bold if not any(each in quote for quote in quotes)] == []


@pytest.mark.parametrize('page', NAMED)
def test_named_files_and_launch_arguments_exist(page):
    known = set(argument.get('name') for path in glob.glob(os.path.join(ROOT, 'launch', '*'))
                for argument in ElementTree.parse(path).iter('arg'))
    for code in re.findall(r'`([^`\n]+)`', prose_of(page)):
        for path in re.findall(r'(?:^|\s)((?:config|doc|launch|msg|rviz|src|test|urdf|worlds)/[\w./]*\w)$', code):
            assert glob.glob(os.path.join(ROOT, path)), path
        if ' ' not in code and not code.startswith('-'):
            assert set(re.findall(r'\b([a-z]\w*):=', code)) - known == set(), code
