"""Names in the README and in doc/: topics, services, files, arguments, messages and figures exist as written.

test_readme_tools.py, test_readme_graphs.py, test_readme_campaign.py and test_readme_cameras.py run the blocks of code.
"""
import ast
import glob
import importlib
import os
import re
import xml.etree.ElementTree as ElementTree

import pytest

from support.code_blocks import PAGES, ROOT, claimed, unclaimed
from support.pages import node_pages

NAMED = PAGES + ('doc/error_model.md',)  # its blocks are the record of a campaign
BENCHMARKS = ['| | here | thesis', '| | `ours` | `thesis`', '| case | markers | 50 %']
DRAWING = claimed('camera/color/image_raw ──►', 'text')
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


def table_of(page, beginning):
    """{first cell of a row: {heading: cell}} of the only table whose first line begins like this."""
    header, = [line for line in text_of(page).splitlines() if line.startswith(beginning)]
    return {row[0]: dict(zip(cells_of(header)[1:], row[1:])) for row in rows_below(page, header)}


def topics_of_nodes(*sections):
    """{full name: type} in the nodes' docstrings, which test_node_pages.py compares with the nodes."""
    return {entry.name.replace('~', node.name + '/'): entry.kind for node in node_pages.nodes()
            for section in sections for entry in node.sections.get(section, ())}


def test_every_block_of_code_is_run():
    for name in ('tools', 'graphs', 'campaign', 'cameras'):
        importlib.import_module('test_readme_' + name)  # they claim their blocks
    assert unclaimed() == []


def test_nodes_and_topics_of_the_drawing_exist():
    for node in re.findall(r'\w+_node', DRAWING.text):
        assert os.path.exists(os.path.join(ROOT, 'scripts', node))
    topics = re.findall(r'\w+(?:/\w+)+|yolo_\w+|visualization_\w+', DRAWING.text)
    assert len(topics) > 6 and set(topics) - set(topics_of_nodes('Subscribes', 'Publishes')) == set()


def test_topics_of_the_table_are_published_with_their_types():
    published = topics_of_nodes('Publishes')
    rows = rows_below('README.md', '| topic | type | |')
    assert len(rows) > 8
    for topics, kind, _meaning in rows:
        for topic in re.findall(r'`([^`]+)`', topics):
            if topic.endswith('/…'):
                assert any(name.startswith(topic[:-1]) for name in published), topic
            else:
                assert topic in published and kind in ('`%s`' % published[topic], ''), topic


def test_services_of_the_readme_are_those_of_the_nodes():
    named = re.findall(r'`(\w+_node/\w+)`(?: and `(\w+_node/\w+)`)? \(`(std_srvs/\w+)`\)', prose_of('README.md'))
    found = {name: kind for *names, kind in named for name in names if name}
    assert len(found) == 3 and found.items() <= topics_of_nodes('Services').items()


@pytest.mark.parametrize('beginning', BENCHMARKS)
def test_figures_of_the_readme_are_those_of_the_benchmarks(beginning):
    measured = table_of('doc/benchmarks.md', beginning)
    shown = table_of('README.md', beginning)
    assert len(shown) > 2
    for name, figures in shown.items():
        assert figures.items() <= measured[name].items(), name


def test_messages_in_the_table_of_symptoms_are_in_the_code():
    """`…` replaces values, in the code conversion specifiers."""
    texts = []
    for path in glob.glob(os.path.join(ROOT, 'src', '**', '*.py'), recursive=True):
        for node in ast.walk(ast.parse(text_of(path))):
            text = getattr(node, 'value', getattr(node, 's', None))  # `s` before Python 3.8
            if isinstance(text, str):
                texts.append(FORMAT.sub('…', text))
    rows = rows_below('README.md', '| what you see | cause | what to do |')
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


@pytest.mark.parametrize('page,header,launch_file', [
    ('README.md', '| argument | |', 'pipeline.launch'), ('doc/realsense.md', '| argument | |', 'realsense.launch')])
def test_arguments_of_tables_are_those_of_the_launch_file(page, header, launch_file):
    tree = ElementTree.parse(os.path.join(ROOT, 'launch', launch_file))
    known = set(argument.get('name') for argument in tree.getroot().findall('arg'))
    listed = set(name for row in rows_below(page, header) for name in re.findall(r'`(\w+)`', row[0]))
    assert len(listed) > 5 and listed <= known


def test_figures_of_other_work_name_their_source():
    rows = rows_below('README.md', '| | they | here |')
    assert len(rows) > 4
    for source, _they, _here in rows:
        assert re.search(r'thesis, chapter \d|\]\(https://\S+\)', source), source
