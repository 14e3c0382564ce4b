"""Links between the pages of the repository lead somewhere, as they are read there (the site checks its own)."""
import glob
import os
import re

import pytest

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
PAGES = sorted(os.path.relpath(path, ROOT) for pattern in ('*.md', 'doc/**/*.md', 'config/**/*.md')
               for path in glob.glob(os.path.join(ROOT, pattern), recursive=True))


def text_of(path):
    """A page without its code, where brackets mean something else."""
    with open(os.path.join(ROOT, path), encoding='utf-8') as stream:
        return re.sub(r'^```.*?^```$|`[^`\n]*`', '', stream.read(), flags=re.MULTILINE | re.DOTALL)


def headings_of(path):
    """The anchors that the repository's own pages give the headings of a page."""
    with open(os.path.join(ROOT, path), encoding='utf-8') as stream:
        text = re.sub(r'^```.*?^```$', '', stream.read(), flags=re.MULTILINE | re.DOTALL)
    titles = re.findall(r'^#+ (.*)$', text, re.MULTILINE)
    return set(re.sub(r'[^\w\- ]', '', title.lower()).replace(' ', '-') for title in titles)


def links_in(path):
    return [target for target in re.findall(r'\]\(([^)\s]+)\)', text_of(path))
            if not re.match(r'https?://|mailto:', target)]


def test_there_is_something_to_check():
    assert 'README.md' in PAGES and sum(len(links_in(path)) for path in PAGES) > 50


@pytest.mark.parametrize('path', PAGES)
def test_links_lead_to_files_and_headings(path):
    for target in links_in(path):
        name, _hash, anchor = target.partition('#')
        linked = os.path.normpath(os.path.join(os.path.dirname(path), name)) if name else path
        assert os.path.exists(os.path.join(ROOT, linked)), target
        assert not anchor or anchor in headings_of(linked), target
