"""The documentation as a site: Sphinx builds it without a warning."""
import subprocess
import sys

import pytest

from support.pages import DOC, ROOT, node_pages


@pytest.mark.slow
@pytest.mark.needs('sphinx')
def test_the_site_has_every_page_and_each_link_has_a_target(tmp_path):
    """Others are errors of Sphinx."""
    node_pages.main()
    subprocess.check_call([sys.executable, '-m', 'sphinx', '-W', '--keep-going', '-n', '-q', '-b', 'html',
                           '-d', str(tmp_path / 'trees'), '-c', DOC, ROOT, str(tmp_path / 'html')])
    for path in ('index', 'launch_files', 'nodes/tracker_node'):
        assert (tmp_path / 'html' / 'doc' / (path + '.html')).exists()
