"""The documentation as a site: Sphinx builds it without a warning, and each page is read in a browser."""
import os
import re
import subprocess
import sys
from urllib.parse import unquote

import pytest

from support.browser import survey
from support.pages import DOC, ROOT

DOC_PAGES = sorted(os.path.relpath(os.path.join(folder, name), DOC)
                   for folder, _folders, names in os.walk(DOC) for name in names if name.endswith('.md'))
PHONE_PX = 400
SEARCH = 'search.html?q=covariance'


@pytest.fixture(scope='module')
def site(tmp_path_factory):
    """The folder of the site. A link without a target, or a page that is not linked, is an error of Sphinx."""
    folder = tmp_path_factory.mktemp('site')
    subprocess.check_call([sys.executable, '-m', 'sphinx', '-W', '--keep-going', '-n', '-q', '-b', 'html',
                           '-d', str(folder / 'trees'), '-c', DOC, ROOT, str(folder / 'html')])
    return folder / 'html'


@pytest.mark.needs('sphinx')
def test_the_site_has_every_page_and_formulas_without_scripts(site):
    for path in DOC_PAGES:
        assert (site / 'doc' / (path[:-len('.md')] + '.html')).exists()
    assert (site / '_images' / 'architecture.svg').exists()
    text = ''.join((site / 'doc' / page).read_text(encoding='utf-8') for page in ('tracking.html', 'error_model.html'))
    formulas = re.findall(r'<math.*?</math>', text, re.DOTALL)
    assert len(formulas) > 30 and not any('\\' in formula for formula in formulas)  # no TeX command remains
    assert not re.search(r'<(script|link|img)[^>]+(src|href)="(https?:)?//', text)


@pytest.mark.needs('chromium', 'sphinx')
def test_pages_work_in_a_browser_on_a_small_screen(site):
    """No message on the console, no broken link or picture, no page wider than the screen, and the search answers."""
    pages = sorted(str(path.relative_to(site)) for path in site.glob('**/*.html'))
    found, console, missing = survey(str(site), pages + [SEARCH], PHONE_PX)
    assert len(pages) > len(DOC_PAGES) and (console, missing) == ([], [])
    assert [page for page in found if found[page]['excess_px'] > 0 or found[page]['empty_images']] == []
    assert found[SEARCH]['results'] > 0
    broken = set()
    for page in pages:
        for link in found[page]['links']:
            target, _hash, anchor = unquote(link).partition('#')
            if target in found and anchor and anchor not in found[target]['ids']:
                broken.add((page, link))
            elif not target.startswith('http') and not (site / target).exists():
                broken.add((page, link))
    assert broken == set()


def test_the_readme_and_the_first_page_lead_to_all_others():
    linked = set()
    for folder, page in (('', '../README.md'), ('', 'index.md'), ('nodes', 'index.md')):
        with open(os.path.join(DOC, folder, page), encoding='utf-8') as stream:
            linked.update(os.path.join(folder, name)
                          for name in re.findall(r'\]\((?:doc/)?([\w/]+\.md)\)', stream.read()))
    assert set(DOC_PAGES) - linked <= {'index.md'}
