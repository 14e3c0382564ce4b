"""Files, launch arguments and messages that the README and doc/ name exist. Other test_readme_*.py run the commands."""
import ast
import glob
import os
import re
import shutil
import xml.etree.ElementTree as ElementTree

import pytest
import yaml

from ros_3d_bb.core.params import SET_BY_LAUNCH, table_of
from support.code_blocks import PAGES, ROOT
from support.pages import figures, node_pages

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


def test_the_table_of_live_parameters_agrees_with_the_code():
    types = {node.name: node_pages.parameter_types(node.node_class) for node in node_pages.nodes()}
    rows = rows_below('doc/tuning.md', '| node | live parameters of its file in [config](../config) |')
    for name, listed in [(name, row[1]) for row in rows for name in re.findall(r'\w+', row[0])]:
        expected = set(parameter for parameter, param in table_of(types.pop(name)).items()
                       if param.section != SET_BY_LAUNCH and bool(param.live) != listed.startswith('all but'))
        assert set(re.findall(r'`(\w+)`', listed)) == expected, name
    assert not any(param.live for kinds in types.values() for param in table_of(kinds).values())


@pytest.mark.parametrize('name', sorted(FIGURES))
def test_pages_quote_the_measured_figure(name):
    for page, quote in FIGURES[name]['quotes'].items():
        assert ' '.join(text_of(page).split()).count(quote.format(FIGURES[name]['value'])) == 1, page


def test_a_new_measurement_is_written_to_the_pages(tmp_path):
    for page in ['doc/figures.yaml'] + [page for figure in FIGURES.values() for page in figure['quotes']]:
        (tmp_path / page).parent.mkdir(exist_ok=True)
        shutil.copy(os.path.join(ROOT, page), str(tmp_path / page))
    hota, ahead_m = {'ours': 84.26, 'thesis': 50.0, 'library': 78.1}, {'ours': 0.504, 'library': 0.604}
    result = {'trackers': {name: {'hota': hota[name], 'fde_2s_m': ahead_m.get(name)} for name in hota},
              'command': './run bench tracking --json some.json'}
    written = figures.write(result, str(tmp_path))
    assert written == ['hota', 'hota_thesis', 'hota_norfair', 'prediction_2s_m', 'prediction_2s_norfair_m']
    assert 'HOTA **84.3** (Norfair **78.1**, thesis **50.0**)' in (tmp_path / 'README.md').read_text(encoding='utf-8')
    new = yaml.safe_load((tmp_path / 'doc' / 'figures.yaml').read_text(encoding='utf-8'))
    assert [new[name]['value'] for name in written] == [84.3, 50.0, 78.1, 0.5, 0.6]
    for command in ('./run bench tracking --seed 1', './run bench tracking --rates', './run bench prediction'):
        assert figures.write(dict(result, command=command), str(tmp_path)) == []


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
        for path in re.findall(r'(?:^|\s)((?:config|doc|launch|msg|rviz|src|test|urdf)/[\w./]*\w)$', code):
            assert glob.glob(os.path.join(ROOT, path)), path
        if ' ' not in code and not code.startswith('-'):
            assert set(re.findall(r'\b([a-z]\w*):=', code)) - known == set(), code
