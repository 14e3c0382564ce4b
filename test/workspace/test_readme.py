"""Files and launch arguments that the README and doc/ name exist. Other test_readme_*.py run the commands."""
import glob
import os
import re
import shutil
import xml.etree.ElementTree as ElementTree

import pytest

from support.code_blocks import PAGES, ROOT
from support.pages import figures


def test_a_new_measurement_is_written_to_the_pages(tmp_path):
    (tmp_path / 'doc').mkdir()
    for page in ('README.md', 'doc/figures.yaml', 'doc/benchmarks.md'):
        shutil.copy(os.path.join(ROOT, page), str(tmp_path / page))
    hota, ahead_m = {'ours': 84.26, 'thesis': 50.0, 'library': 78.1}, {'ours': 0.504, 'library': 0.604}
    result = {'trackers': {name: {'hota': hota[name], 'fde_2s_m': ahead_m.get(name)} for name in hota},
              'command': './run bench tracking --json some.json'}
    assert 'hota' in figures.write(result, str(tmp_path))
    assert 'HOTA **84.3** (Norfair **78.1**, thesis **50.0**)' in (tmp_path / 'README.md').read_text(encoding='utf-8')


@pytest.mark.parametrize('page', PAGES)
def test_named_files_and_launch_arguments_exist(page):
    known = set(argument.get('name') for path in glob.glob(os.path.join(ROOT, 'launch', '*'))
                for argument in ElementTree.parse(path).iter('arg'))
    with open(os.path.join(ROOT, page), encoding='utf-8') as stream:
        prose = re.sub(r'^```.*?^```$', '', stream.read(), flags=re.DOTALL | re.MULTILINE)
    for code in re.findall(r'`([^`\n]+)`', prose):
        for path in re.findall(r'(?:^|\s)((?:config|doc|launch|msg|rviz|src|test|urdf|worlds)/[\w./]*\w)$', code):
            assert glob.glob(os.path.join(ROOT, path)), path
        if ' ' not in code and not code.startswith('-'):
            assert set(re.findall(r'\b([a-z]\w*):=', code)) - known == set(), code
