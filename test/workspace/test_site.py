"""The documentation as a site: Sphinx builds it without a warning, and each page is linked."""
import os
import re
import subprocess
import sys

from support.pages import DOC, ROOT

DOC_PAGES = sorted(os.path.relpath(os.path.join(folder, name), DOC)
                   for folder, _folders, names in os.walk(DOC) for name in names if name.endswith('.md'))


def test_the_site_has_every_page_and_formulas_without_scripts(tmp_path):
    """A link without a target, or a page that is not linked, is an error of Sphinx."""
    subprocess.check_call([sys.executable, '-m', 'sphinx', '-W', '--keep-going', '-n', '-q', '-b', 'html',
                           '-d', str(tmp_path / 'trees'), '-c', DOC, ROOT, str(tmp_path / 'html')])
    site = tmp_path / 'html' / 'doc'
    for path in DOC_PAGES:
        assert (site / (path[:-len('.md')] + '.html')).exists()
    assert (site.parent / '_images' / 'architecture.svg').exists()
    text = ''.join((site / page).read_text(encoding='utf-8') for page in ('tracking.html', 'error_model.html'))
    formulas = re.findall(r'<math.*?</math>', text, re.DOTALL)
    assert len(formulas) > 30 and not any('\\' in formula for formula in formulas)  # no TeX command remains
    assert not re.search(r'<(script|link|img)[^>]+(src|href)="(https?:)?//', text)


def test_the_readme_and_the_first_page_lead_to_all_others():
    linked = set()
    for folder, page in (('', '../README.md'), ('', 'index.md'), ('nodes', 'index.md')):
        with open(os.path.join(DOC, folder, page), encoding='utf-8') as stream:
            linked.update(os.path.join(folder, name)
                          for name in re.findall(r'\]\((?:doc/)?([\w/]+\.md)\)', stream.read()))
    assert set(DOC_PAGES) - linked <= {'index.md'}
