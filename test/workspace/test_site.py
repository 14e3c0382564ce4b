"""The documentation as a site: Sphinx builds it without a warning."""
import glob
import os
import re
import subprocess
import sys

import pytest

from support.pages import DOC, ROOT, node_pages


@pytest.mark.slow
@pytest.mark.needs('sphinx')
def test_the_site_has_every_page_and_formulas_without_scripts(tmp_path):
    """A link without a target, or a page that is not linked, is an error of Sphinx."""
    node_pages.main()
    subprocess.check_call([sys.executable, '-m', 'sphinx', '-W', '--keep-going', '-n', '-q', '-b', 'html',
                           '-d', str(tmp_path / 'trees'), '-c', DOC, ROOT, str(tmp_path / 'html')])
    pages = tmp_path / 'html' / 'doc'
    for path in ('index', 'launch_files', os.path.join('nodes', 'tracker_node')):
        assert (pages / (path + '.html')).exists()
    formulas = re.findall(r'<math.*?</math>', (pages / 'tracking.html').read_text(encoding='utf-8'), re.DOTALL)
    assert len(formulas) > 20 and not any('\\' in formula for formula in formulas)  # no TeX command remains


@pytest.mark.parametrize('path', sorted(glob.glob(os.path.join(ROOT, '*.md')) + glob.glob(os.path.join(DOC, '*.md'))),
                         ids=os.path.basename)
def test_no_line_is_taken_for_a_comment_or_an_item(path):
    """MyST takes lines that begin with a percent sign for comments, Markdown those with a plus sign for items."""
    with open(path, encoding='utf-8') as stream:
        assert not re.search(r'^ *(%|\+ )', stream.read(), re.MULTILINE)
