"""The pages as a site: Sphinx builds them without a warning, and each page can be reached."""
import os
import re
import subprocess
import sys

import pytest

from support.pages import DOC, ROOT


@pytest.fixture(scope='module')
def site(tmp_path_factory):
    """The folder of the pages of doc/; a link without a target, or a page that is not linked, is an error."""
    folder = tmp_path_factory.mktemp('site')
    subprocess.check_call([sys.executable, '-m', 'sphinx', '-W', '--keep-going', '-n', '-q', '-b', 'html',
                           '-d', str(folder / 'trees'), '-c', DOC, ROOT, str(folder / 'html')])
    return folder / 'html' / 'doc'


def test_the_site_has_every_page_and_what_they_link(site):
    for path in DOC_PAGES:
        assert (site / (path[:-len('.md')] + '.html')).exists()
    assert (site.parent / '_images' / 'architecture.svg').exists()


def test_formulas_need_no_script(site):
    text = ''.join((site / page).read_text(encoding='utf-8') for page in ('tracking.html', 'error_model.html'))
    formulas = re.findall(r'<math.*?</math>', text, re.DOTALL)
    assert len(formulas) > 30 and not any('\\' in formula for formula in formulas)  # nothing that is not understood
    assert not re.search(r'<(script|link|img)[^>]+(src|href)="(https?:)?//', text)


def test_the_readme_and_the_first_page_lead_to_all_others():
    linked = set()
    for folder, page in (('', '../README.md'), ('', 'index.md'), ('nodes', 'index.md')):
        with open(os.path.join(DOC, folder, page), encoding='utf-8') as stream:
            linked.update(os.path.join(folder, name)
                          for name in re.findall(r'\]\((?:doc/)?([\w/]+\.md)\)', stream.read()))
    assert set(DOC_PAGES) - linked <= {'index.md'}


DOC_PAGES = sorted(os.path.relpath(os.path.join(folder, name), DOC)
                   for folder, _folders, names in os.walk(DOC) for name in names if name.endswith('.md'))
