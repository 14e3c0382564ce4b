"""Names in the README and in doc/: topics, services, files, arguments, messages and figures exist as written.

test_readme_tools.py, test_readme_graphs.py, test_readme_campaign.py and test_readme_cameras.py run the blocks of code,
test_readme_container.py checks those with containers.
"""
import ast
import glob
import importlib
import os
import re
import xml.etree.ElementTree as ElementTree

import pytest

from ros_3d_bb.planning.planner_outputs import NAMES, OPTIONAL
from support.code_blocks import PAGES, ROOT, claimed, unclaimed
from support.pages import node_pages

NAMED = PAGES + ('doc/error_model.md',)  # its blocks are the record of a campaign
DRAWING, CITATION = claimed('camera/color/image_raw ──►', 'text'), claimed('@mastersthesis', 'bibtex')
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


def section_of(page, title):
    """Text below the heading of the second level."""
    _before, text = text_of(page).split('\n## %s\n' % title)
    return text.split('\n## ')[0]


def figures_in(text):
    """Words of all table cells."""
    return set(word for line in text.splitlines() if line.startswith('|')
               for cell in cells_of(line) for word in [cell] + re.split('[, ]+', cell))


def topics_of_nodes(*sections):
    """{full name: type} in the nodes' docstrings, which test_node_pages.py compares with the nodes."""
    return {entry.name.replace('~', node.name + '/'): entry.kind for node in node_pages.nodes()
            for section in sections for entry in node.sections.get(section, ())}


@pytest.mark.needs('pyrealsense2')
def test_every_block_of_code_is_run():
    for name in ('tools', 'graphs', 'campaign', 'cameras', 'container'):
        importlib.import_module('test_readme_' + name)  # they claim their blocks
    assert unclaimed() == []


def test_nodes_and_topics_of_the_drawing_exist():
    for node in re.findall(r'\w+_node', DRAWING.text):
        assert os.path.exists(os.path.join(ROOT, 'scripts', node))
    topics = re.findall(r'\w+(?:/\w+)+|yolo_\w+|visualization_\w+', DRAWING.text)
    assert len(topics) > 6 and set(topics) - set(topics_of_nodes('Subscribes', 'Publishes')) == set()


def test_topics_of_the_table_are_published_with_their_types():
    published = topics_of_nodes('Publishes')
    rows = rows_below('doc/topics.md', '| topic | type | |')
    assert len(rows) > 8
    for topics, kind, _meaning in rows:
        for topic in re.findall(r'`([^`]+)`', topics):
            if topic.endswith('/…'):
                assert any(name.startswith(topic[:-1]) for name in published), topic
            else:
                assert topic in published and kind in ('`%s`' % published[topic], ''), topic


def test_services_of_the_table_are_those_of_the_nodes():
    named = re.findall(r'`(\w+_node/\w+)`(?: and `(\w+_node/\w+)`)? \(`(std_srvs/\w+)`\)', prose_of('doc/topics.md'))
    found = {name: kind for *names, kind in named for name in names if name}
    assert len(found) == 3 and found.items() <= topics_of_nodes('Services').items()


def test_the_readme_is_short_and_has_three_tables():
    lines = text_of('README.md').splitlines()
    assert len(lines) < 200
    assert len([line for line in lines if line.startswith('|---')]) == 3


def test_figures_of_the_readme_are_those_of_the_benchmarks():
    lines = [line for line in section_of('README.md', 'Accuracy and speed').splitlines() if line.startswith('- ')]
    assert len(lines) == 5
    for line in lines:
        heading = re.search(r'benchmarks\.md#([\w-]+)', line).group(1).replace('-', ' ').capitalize()
        figures = re.findall(r'\*\*(.+?)\*\*', line)
        assert figures and set(figures) <= figures_in(section_of('doc/benchmarks.md', heading)), line


def test_planners_of_the_readme_are_the_outputs_of_the_bridge():
    shown = {row[0].strip('`'): row[2] for row in rows_below('README.md', '| `planner:=` | for | package needed | '
                                                             'tested with |')}
    assert set(shown) == set(NAMES)
    for name, topic in rows_below('doc/planners.md', '| `planner:=` | topic, type |'):
        output = OPTIONAL.get(name.strip('`'))
        assert output is None or (topic == '`%s`, `%s`' % (output.topic, output.kind)
                                  and shown[name.strip('`')] == '`%s`' % output.kind.split('/')[0])


def test_the_citation_is_bibtex_of_the_thesis():
    fields = dict(re.findall(r'^  (\w+) = {(.*)},?$', CITATION.text, re.MULTILINE))
    assert CITATION.text.count('{') == CITATION.text.count('}') and CITATION.text.endswith('}\n}\n')
    assert {'author', 'title', 'school', 'type', 'year'} <= set(fields)
    source = ' '.join(section_of('doc/tracking.md', 'Sources').split())
    assert fields['title'] in source and '%s %s' % (fields['school'].split(',')[0], fields['year']) in source


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


@pytest.mark.parametrize('page,header,launch_file', [
    ('doc/robot.md', '| argument | |', 'pipeline.launch'), ('doc/realsense.md', '| argument | |', 'realsense.launch')])
def test_arguments_of_tables_are_those_of_the_launch_file(page, header, launch_file):
    tree = ElementTree.parse(os.path.join(ROOT, 'launch', launch_file))
    known = set(argument.get('name') for argument in tree.getroot().findall('arg'))
    listed = set(name for row in rows_below(page, header) for name in re.findall(r'`(\w+)`', row[0]))
    assert len(listed) > 5 and listed <= known


def test_figures_of_other_work_name_their_source():
    rows = rows_below('doc/benchmarks.md', '| | they | here |')
    assert len(rows) > 4
    for source, _they, _here in rows:
        assert re.search(r'thesis, chapter \d|\]\(https://\S+\)', source), source
